// The moving arm with a slider of time and a button: in its plane, or in space as two views that turn.
"use strict";

const MovingArm = (() => {
  const PAD = 14, DEGREE = Math.PI / 180, TURN = 15;
  // Where each view of space begins, azimuth and elevation of the eye in degrees: -90, 0 looks along y.
  const VIEWS = [["from the side", -60, 18], ["from above", -90, 90]];
  const STRAIGHT = [["side", -90, 0], ["front", 0, 0], ["top", -90, 90]];

  const middle = (a, b) => 0.5 * (a + b);
  const chain = (points) => points.map((p) => `${p[0].toFixed(1)},${p[1].toFixed(1)}`).join(" ");
  const line = (a, b, name = "grid") => `<line class="${name}" x1="${a[0].toFixed(1)}" y1="${a[1].toFixed(1)}" x2="${b[0].toFixed(1)}" y2="${b[1].toFixed(1)}"/>`;

  function pins(points) {
    return points.map(([x, y], i) => (i ? `<circle class="pin" r="5" cx="${x.toFixed(1)}" cy="${y.toFixed(1)}"/>`
      : `<rect class="pin" x="${(x - 7).toFixed(1)}" y="${(y - 7).toFixed(1)}" width="14" height="14"/>`)).join("");
  }

  // What both kinds of view draw: the still ground, the end's way, its last second, the arm.
  function canvas(host, words) {
    host.innerHTML = `<svg role="img" aria-label="${Plot.escape(words)}"><g class="ground"></g><polyline class="way"/><polyline class="shadow"/><polyline class="trail"/><polyline class="arm"/><g class="joints"></g></svg>`;
    const svg = host.firstChild, part = (name) => svg.querySelector(name);
    const size = (width, height) => {
      svg.setAttribute("viewBox", `0 0 ${Math.ceil(width)} ${Math.ceil(height)}`);
      svg.style.maxWidth = `${Math.ceil(width)}px`;
    };
    const show = (frame, ends, at, shadow) => {
      const points = frame.map(at);
      part(".arm").setAttribute("points", chain(points));
      part(".trail").setAttribute("points", chain(ends.map(at)));
      part(".joints").innerHTML = pins(points);
      if (shadow) part(".shadow").setAttribute("points", chain(frame.map(shadow)));
    };
    return {size, show, ground: (text) => { part(".ground").innerHTML = text; }, way: (points) => part(".way").setAttribute("points", chain(points))};
  }

  // The plane of a flat arm with both axes of one scale.
  function plane(host, {low: least, high: most, axes}, ends) {
    const drawn = canvas(host, "the arm in its plane");
    const reach = Math.max(most[0] - least[0], most[1] - least[1], 1e-3), pad = 0.06 * reach;
    // Neither side shorter than a third of the other: a motion along a line still is a picture.
    const half = [0, 1].map((k) => Math.max(0.5 * (most[k] - least[k]) + pad, reach / 6));
    const low = [0, 1].map((k) => middle(least[k], most[k]) - half[k]), high = low.map((v, k) => v + 2 * half[k]);
    const left = 54, top = 8, bottom = 36, room = Math.max(220, Math.min(450, (host.clientWidth || 516) - left - 12));
    const scale = Math.min(room / (high[0] - low[0]), 400 / (high[1] - low[1]));
    const inner = scale * (high[0] - low[0]), height = scale * (high[1] - low[1]);
    const at = ([x, y]) => [left + (x - low[0]) * scale, top + (high[1] - y) * scale];
    let ground = "";
    const xTicks = Plot.linearTicks(low[0], high[0], inner / 70), yTicks = Plot.linearTicks(low[1], high[1], height / 45);
    const xWords = Plot.tickWords(xTicks), yWords = Plot.tickWords(yTicks);
    for (const [v] of xTicks) {
      const [px] = at([v, 0]);
      ground += `${line([px, top], [px, top + height])}<text class="tick" x="${px.toFixed(1)}" y="${top + height + 15}" text-anchor="middle">${xWords(v)}</text>`;
    }
    for (const [v] of yTicks) {
      const [, py] = at([0, v]);
      ground += `${line([left, py], [left + inner, py])}<text class="tick" x="${left - 6}" y="${py.toFixed(1)}" dy=".32em" text-anchor="end">${yWords(v)}</text>`;
    }
    ground += `<rect class="frame" x="${left}" y="${top}" width="${inner}" height="${height}"/><text class="axis" x="${left + inner / 2}" y="${top + height + bottom - 5}" text-anchor="middle">${axes[0]} [m]</text><text class="axis" transform="translate(13 ${top + height / 2}) rotate(-90)" text-anchor="middle">${axes[1]} [m]</text>`;
    drawn.size(left + inner + 12, top + height + bottom);
    drawn.ground(ground);
    drawn.way(ends.map(at));
    return {show: (frame, last) => drawn.show(frame, last, at)};
  }

  // A view of space without perspective: lengths across it are true. Whatever it is turned to, all stays within it.
  function space(host, {low, high, axes}, frames, ends, [name, azimuth, elevation], redraw) {
    const title = document.createElement("b"), field = document.createElement("div"), buttons = document.createElement("div");
    title.textContent = name;
    field.className = "plot";
    field.tabIndex = 0;
    field.setAttribute("role", "group");
    field.setAttribute("aria-label", `the arm ${name}: arrow keys turn it, Home turns it back`);
    buttons.className = "tools";
    host.append(title, buttons, field);
    const drawn = canvas(field, `the arm in space, ${name}`), width = Math.max(240, field.clientWidth || 360), height = Math.min(400, width);
    const floor = [0, 1].map((k) => [Math.min(low[k], 0), Math.max(high[k], 0)]);
    const heart = [middle(...floor[0]), middle(...floor[1]), middle(Math.min(low[2], 0), Math.max(high[2], 0))];
    const step = Plot.linearTicks(0, Math.max(...floor.map(([a, b]) => b - a), 1e-3), 8)[1][0];
    const along = floor.map(([a, b]) => [step * Math.floor(a / step + 1e-9), step * Math.ceil(b / step - 1e-9)]);
    const corners = along[0].flatMap((x) => along[1].map((y) => [x, y, 0]));
    const far = [...corners, ...frames.flat()].reduce((most, p) => Math.max(most, Math.hypot(...p.map((v, k) => v - heart[k]))), 0);
    const scale = (height / 2 - PAD) / far;
    let view = [azimuth, elevation], at = null;
    drawn.size(width, height);

    function turn(to) {
      view = [((to[0] + 540) % 360) - 180, Math.max(-90, Math.min(90, to[1]))];
      const [a, e] = view.map((v) => v * DEGREE), sa = Math.sin(a), ca = Math.cos(a), se = Math.sin(e), ce = Math.cos(e);
      at = (p) => {
        const [x, y, z] = p.map((v, k) => v - heart[k]);
        return [width / 2 + scale * (ca * y - sa * x), height / 2 - scale * (ce * z - se * (ca * x + sa * y))];
      };
      const lines = (k) => {
        const found = [];
        for (let v = along[k][0]; v <= along[k][1] + 1e-9; v += step) found.push(v);
        return found;
      };
      let ground = lines(0).map((x) => line(at([x, along[1][0], 0]), at([x, along[1][1], 0]))).join("");
      ground += lines(1).map((y) => line(at([along[0][0], y, 0]), at([along[0][1], y, 0]))).join("");
      const zero = at([0, 0, 0]);
      axes.forEach((word, k) => {
        const tip = at([0, 1, 2].map((i) => (i === k ? 1.2 * step : 0)));
        // An axis that points at the eye has no place for its name.
        if (Math.hypot(tip[0] - zero[0], tip[1] - zero[1]) < 9) return;
        const label = at([0, 1, 2].map((i) => (i === k ? 1.55 * step : 0)));
        ground += line(zero, tip, "zero") + `<text class="axis" x="${label[0].toFixed(1)}" y="${label[1].toFixed(1)}" dy=".32em" text-anchor="middle">${word}</text>`;
      });
      ground += `<text class="tick" x="${width - 4}" y="${height - 5}" text-anchor="end">squares of ${Plot.number(step)} m</text>`;
      drawn.ground(ground);
      drawn.way(ends.map(at));
      [host.dataset.azimuth, host.dataset.elevation] = view.map((v) => v.toFixed(1));
    }
    const again = (to) => { turn(to); redraw(); };
    turn(view);

    for (const [word, ...to] of STRAIGHT) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = word;
      button.onclick = () => again(to);
      buttons.append(button);
    }
    field.addEventListener("keydown", (event) => {
      const by = {ArrowLeft: [TURN, 0], ArrowRight: [-TURN, 0], ArrowUp: [0, -TURN], ArrowDown: [0, TURN]}[event.key];
      if (!by && event.key !== "Home") return;
      event.preventDefault();
      again(by ? view.map((v, k) => v + by[k]) : [azimuth, elevation]);
    });
    let from = null;
    field.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      from = [event.clientX, event.clientY, ...view];
      field.setPointerCapture(event.pointerId);
    });
    field.addEventListener("pointermove", (event) => {
      // The width of the view is half a turn.
      const degrees = 180 / field.clientWidth;
      if (from) again([from[2] - degrees * (event.clientX - from[0]), from[3] + degrees * (event.clientY - from[1])]);
    });
    for (const end of ["pointerup", "pointercancel"]) field.addEventListener(end, () => { from = null; });
    return {show: (frame, last) => drawn.show(frame, last, at, ([x, y]) => at([x, y, 0]))};
  }

  function show(element, data) {
    const host = element.querySelector(".views");
    const slider = element.querySelector("input"), button = element.querySelector("[data-play]"), clock = element.querySelector("output");
    const flat = Plot.unpack(data.frames), {period, points: count, axes} = data, each = count * axes.length;
    const frames = Array.from({length: flat.n / each}, (_, f) => Array.from({length: count}, (_, p) => axes.map((_, k) => flat.at(f * each + p * axes.length + k))));
    const ends = frames.map((frame) => frame[count - 1]), second = Math.max(1, Math.round(1 / period));
    let now = 0;
    const redraw = () => views.forEach((view) => view.show(frames[now], ends.slice(Math.max(0, now - second), now + 1)));
    const place = () => host.appendChild(document.createElement("div"));
    const views = [];
    if (axes.length === 2) {
      const field = place();
      field.className = "plot";
      views.push(plane(field, data, ends));
    } else {
      // Both have their width before one is drawn.
      const places = VIEWS.map(place);
      VIEWS.forEach((view, k) => views.push(space(places[k], data, frames, ends, view, redraw)));
    }
    const go = (k) => {
      now = k;
      redraw();
      clock.textContent = `${(k * period).toFixed(1)} s`;
      slider.value = k;
    };
    let began = null;
    const step = (time) => {
      if (began === null) return;
      // The time of a frame may lie before that of the click that asked for it.
      go(Math.floor(Math.max(0, time - began) / 1000 / period) % frames.length);
      requestAnimationFrame(step);
    };
    slider.max = frames.length - 1;
    slider.oninput = () => { began = null; button.textContent = "▶ move"; go(+slider.value); };
    button.onclick = () => {
      const running = began !== null;
      began = running ? null : performance.now() - 1000 * period * slider.value;
      button.textContent = running ? "▶ move" : "❚❚ stop";
      if (!running) requestAnimationFrame(step);
    };
    go(0);
    element.dataset.drawn = "true";
  }

  return {show};
})();
