// What the theme leaves to say for those who do not see, or use no mouse: names for the buttons of a block of code, and
// tables and code that the keyboard can scroll.
const tell = () => {
  document.querySelectorAll("nav.md-code__nav:not([aria-label])").forEach((nav, k) => nav.setAttribute("aria-label", `Code ${nav.parentElement.id.replace(/\D+/g, "") || k}`));
  document.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])").forEach((table) => table.setAttribute("tabindex", "0"));
  document.querySelectorAll("pre > code:not([tabindex])").forEach((code) => { if (code.scrollWidth > code.clientWidth) code.setAttribute("tabindex", "0"); });
};
new MutationObserver(tell).observe(document.documentElement, { childList: true, subtree: true });
addEventListener("load", tell);
addEventListener("resize", tell);
tell();
