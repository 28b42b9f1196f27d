// What the theme leaves to say for those who do not see, or use no mouse: names for the buttons of a block of code,
// tables and code that the keyboard can scroll, and no two parts of the navigation with one name.
const tell = () => {
  document.querySelectorAll("nav.md-code__nav:not([aria-label])").forEach((nav, k) => nav.setAttribute("aria-label", `Code ${nav.parentElement.id.replace(/\D+/g, "") || k}`));
  document.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])").forEach((table) => table.setAttribute("tabindex", "0"));
  document.querySelectorAll("pre > code:not([tabindex])").forEach((code) => { if (code.scrollWidth > code.clientWidth) code.setAttribute("tabindex", "0"); });
  const seen = new Map();
  document.querySelectorAll("nav[aria-label]").forEach((nav) => {
    const name = nav.dataset.name ??= nav.getAttribute("aria-label"), key = name.toLowerCase(), times = (seen.get(key) ?? 0) + 1;
    seen.set(key, times);
    nav.setAttribute("aria-label", times > 1 ? `${name} ${times}` : name);
  });
};
new MutationObserver(tell).observe(document.documentElement, { childList: true, subtree: true });
addEventListener("load", tell);
addEventListener("resize", tell);
tell();
