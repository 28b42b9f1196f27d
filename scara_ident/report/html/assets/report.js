// The page: figures with their selectors, zoom, read-out and theme.
"use strict";

(() => {
  const content = JSON.parse(document.getElementById("report-data").textContent);
  const figures = new Map();
  const groups = new Map();
  // CSS pixels between the margins of A4.
  const PAPER = 688;
  let printing = false;

  class Figure {
    constructor(element) {
      this.element = element;
      this.id = element.dataset.figure;
      this.entry = content.figures[this.id];
      this.host = element.querySelector(".plot");
      this.legend = element.querySelector(".legend");
      this.state = {view: null, hidden: new Set()};
      this.plot = null;
    }

    get group() { return groups.get(this.element.closest("[data-group]")?.dataset.group); }
    get key() { return this.entry.by.map((k) => this.group.choice[k]).join(","); }
    get spec() { return this.entry.variants[this.key]; }

    draw() {
      const spec = this.spec;
      this.element.hidden = !spec;
      this.element.dataset.drawn = "true";
      if (!spec) return;
      this.plot = Plot.draw(this.host, spec, this.state, printing ? this.paperWidth : 0);
      this.drawLegend(spec);
      if (this.plot) [this.element.dataset.x0, this.element.dataset.x1] = this.plot.view;
    }

    // On paper a figure is drawn for its width there, so that its words keep their size.
    get paperWidth() {
      const columns = this.element.closest(".three") ? 3 : this.element.closest(".two") ? 2 : 1;
      return (PAPER - 18 * (columns - 1)) / columns / (this.element.closest(".beside") ? 2 : 1);
    }

    drawLegend(spec) {
      const seen = new Map();
      for (const panel of spec.panels || []) for (const layer of panel.layers) if (layer.name && !seen.has(layer.name)) seen.set(layer.name, layer);
      const names = [...seen.keys()].join("|");
      if (this.legend.dataset.names === names) return;
      this.legend.dataset.names = names;
      this.legend.replaceChildren(...[...seen].map(([name, layer]) => {
        const item = document.createElement("button");
        const kind = {band: "band", density: "band", region: "band", dots: "dot"}[layer.t] || "stroke";
        item.type = "button";
        item.innerHTML = `<i class="${kind}${layer.d || layer.t === "h" ? (parseFloat(layer.d) <= 2 ? " dotted" : " dashed") : ""}" style="--c:var(--c-${layer.c})"></i>${Plot.escape(name)}`;
        item.title = "show or hide";
        item.setAttribute("aria-pressed", "true");
        item.onclick = () => {
          const {hidden} = this.state;
          if (!hidden.delete(name)) hidden.add(name);
          item.setAttribute("aria-pressed", String(!hidden.has(name)));
          this.draw();
        };
        return item;
      }));
    }

    zoom(x0, x1) {
      if (!this.plot) return;
      const [low, high] = this.plot.full;
      const least = (high - low) * 1e-5;
      [x0, x1] = [Math.max(low, Math.min(x0, x1)), Math.min(high, Math.max(x0, x1))];
      if (x1 - x0 < least) return;
      this.state.view = x0 <= low && x1 >= high ? null : [x0, x1];
      this.draw();
    }

    reset() { this.state.view = null; this.draw(); }

    // Shrinks (factor below 1) or widens what is shown about a place, by default the middle.
    scale(factor, about) {
      const [x0, x1] = this.plot.view, at = about ?? 0.5 * (x0 + x1);
      this.zoom(at - (at - x0) * factor, at + (x1 - at) * factor);
    }

    move(share) {
      const [x0, x1] = this.plot.view, [low, high] = this.plot.full;
      const by = Math.max(low - x0, Math.min(high - x1, share * (x1 - x0)));
      this.zoom(x0 + by, x1 + by);
    }

    listen() {
      const {host} = this;
      const local = (event) => {
        const box = host.getBoundingClientRect();
        return (event.clientX - box.left) * (this.plot.width / box.width);
      };
      let start = null, pinch = null;
      const fingers = new Map();
      host.addEventListener("pointerdown", (event) => {
        if (!this.plot || event.button) return;
        fingers.set(event.pointerId, local(event));
        if (fingers.size === 2) {
          pinch = {view: [...this.plot.view], at: [...fingers.values()].map(this.plot.toX)};
          start = null;
        } else if (event.pointerType === "touch") {
          start = this.state.view ? {pan: local(event), view: [...this.plot.view]} : null;
        } else {
          start = event.shiftKey ? {pan: local(event), view: [...this.plot.view]} : {pick: local(event)};
          host.setPointerCapture(event.pointerId);
        }
      });
      host.addEventListener("pointermove", (event) => {
        if (!this.plot) return;
        const px = local(event);
        if (fingers.has(event.pointerId)) fingers.set(event.pointerId, px);
        if (pinch && fingers.size === 2) {
          const [a, b] = [...fingers.values()].sort((p, q) => p - q), [u, v] = [...pinch.at].sort((p, q) => p - q);
          const slope = (v - u) / Math.max(8, b - a);
          this.zoom(u - (a - this.plot.left) * slope, u + (this.plot.left + this.plot.inner - a) * slope);
        } else if (start?.pick !== undefined) {
          const pick = host.querySelector(".pick"), [a, b] = [Math.min(px, start.pick), Math.max(px, start.pick)];
          pick.setAttribute("x", a); pick.setAttribute("width", b - a); pick.setAttribute("visibility", "visible");
        } else if (start) {
          const by = ((start.pan - px) / this.plot.inner) * (start.view[1] - start.view[0]);
          const [low, high] = this.plot.full, clipped = Math.max(low - start.view[0], Math.min(high - start.view[1], by));
          this.zoom(start.view[0] + clipped, start.view[1] + clipped);
        } else this.read(event, px);
      });
      const end = (event) => {
        fingers.delete(event.pointerId);
        if (fingers.size < 2) pinch = null;
        if (start?.pick !== undefined && event.type === "pointerup") {
          const px = local(event), from = start.pick;
          start = null;
          if (Math.abs(px - from) > 5) this.zoom(this.plot.toX(from), this.plot.toX(px));
          else host.querySelector(".pick").setAttribute("visibility", "hidden");
        }
        start = null;
      };
      host.addEventListener("pointerup", end);
      host.addEventListener("pointercancel", end);
      host.addEventListener("pointerleave", () => this.hush());
      host.addEventListener("dblclick", () => this.plot && this.reset());
      host.addEventListener("keydown", (event) => {
        const act = {"+": () => this.scale(0.5), "=": () => this.scale(0.5), "-": () => this.scale(2), "0": () => this.reset(), ArrowLeft: () => this.move(-0.25), ArrowRight: () => this.move(0.25)}[event.key];
        if (act && this.plot) { event.preventDefault(); act(); }
      });
      for (const button of this.element.querySelectorAll("[data-act]")) {
        button.onclick = () => ({in: () => this.scale(0.5), out: () => this.scale(2), back: () => this.move(-0.5), on: () => this.move(0.5), all: () => this.reset()})[button.dataset.act]();
      }
    }

    // Values under the pointer.
    read(event, px) {
      const {plot} = this;
      if (px < plot.left || px > plot.left + plot.inner) { this.hush(); return; }
      const at = plot.toX(px), lines = [];
      for (const {shown} of plot.geometry) {
        for (const layer of shown) {
          if (layer.t !== "line" || !layer.name || !layer.x.n || layer.path) continue;
          let i = Math.min(layer.x.n - 1, Plot.lowerBound(layer.x, at));
          if (i > 0 && Math.abs(layer.x.at(i - 1) - at) < Math.abs(layer.x.at(i) - at)) i--;
          const panel = plot.geometry.find((g) => g.shown.includes(layer));
          const value = layer.y.at(i);
          if (Number.isFinite(value)) lines.push(`<i class="stroke" style="--c:var(--c-${layer.c})"></i>${Plot.escape(layer.name)} <b>${Plot.number(panel.log ? 10 ** value : value)}</b>`);
        }
      }
      if (!lines.length) { this.hush(); return; }
      const cross = this.host.querySelector(".cross");
      for (const side of ["x1", "x2"]) cross.setAttribute(side, px);
      cross.setAttribute("visibility", "visible");
      tip.innerHTML = `<span>${Plot.escape(this.spec.x.label)} <b>${Plot.number(plot.logX ? 10 ** at : at)}</b></span>` + lines.map((line) => `<span>${line}</span>`).join("");
      tip.hidden = false;
      const room = window.innerWidth - tip.offsetWidth - 8;
      tip.style.left = `${Math.max(4, Math.min(room, event.clientX + 14))}px`;
      tip.style.top = `${Math.max(4, Math.min(window.innerHeight - tip.offsetHeight - 8, event.clientY + 14))}px`;
    }

    hush() {
      tip.hidden = true;
      this.host.querySelector(".cross")?.setAttribute("visibility", "hidden");
    }
  }

  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  document.body.append(tip);

  function choose(group, place, value) {
    group.choice[place] = value;
    for (const figure of group.figures) {
      if (!figure.entry.by.includes(place)) continue;
      figure.state.view = null;
      figure.draw();
    }
  }

  for (const element of document.querySelectorAll("[data-group]")) {
    const selects = [...element.querySelectorAll("select[data-place]")];
    const group = {element, selects, choice: selects.map((select) => select.selectedIndex), figures: []};
    groups.set(element.dataset.group, group);
    selects.forEach((select, place) => { select.onchange = () => choose(group, place, select.selectedIndex); });
  }
  for (const button of document.querySelectorAll("[data-choose]")) {
    button.onclick = () => {
      const group = groups.get(button.dataset.choose);
      JSON.parse(button.dataset.values).forEach((value, place) => {
        group.selects[place].selectedIndex = value;
        choose(group, place, value);
      });
      group.element.scrollIntoView({behavior: "smooth", block: "start"});
    };
  }

  for (const element of document.querySelectorAll("[data-figure]")) {
    const figure = new Figure(element);
    figures.set(figure.id, figure);
    figure.group.figures.push(figure);
    figure.listen();
  }
  const all = () => figures.forEach((figure) => figure.draw());

  const themes = ["auto", "light", "dark"], toggle = document.getElementById("theme");
  toggle.onclick = () => {
    const next = themes[(themes.indexOf(document.documentElement.dataset.theme) + 1) % 3];
    document.documentElement.dataset.theme = next;
    toggle.textContent = `theme: ${next}`;
    all();
  };
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  window.addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((d) => { d.open = true; });
    printing = true;
    all();
  });
  window.addEventListener("afterprint", () => { printing = false; all(); });
  let wide = window.innerWidth, timer = 0;
  window.addEventListener("resize", () => {
    clearTimeout(timer);
    timer = setTimeout(() => { if (window.innerWidth !== wide) { wide = window.innerWidth; all(); } }, 120);
  });

  // A few figures at a time, so that the page answers while the rest is drawn.
  const waiting = [...figures.values()];
  const some = () => {
    const until = performance.now() + 40;
    while (waiting.length && performance.now() < until) waiting.shift().draw();
    if (waiting.length) setTimeout(some); else document.documentElement.dataset.ready = "true";
  };
  document.querySelectorAll("[data-arm]").forEach((element) => MovingArm.show(element, content.arms[element.dataset.arm]));
  some();
  window.report = {figures};
})();
