// Draws one figure: stacked panels over a common x axis, or a matrix, as SVG whose colours are CSS variables.
// Lines of any length are drawn as the extent of each pixel column, so that no peak is lost at any zoom.
"use strict";

const Plot = (() => {
  const LEFT = 62, RIGHT = 12, TOP = 8, GAP = 12, BOTTOM = 38;
  const NO_VALUE = -32768;
  // Width of a character of a tick, px.
  const DIGIT = 6.8;
  let clips = 0;

  const escape = (text) => String(text).replace(/[&<>"]/g, (c) => ({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"})[c]);

  function bytes(text) {
    const raw = atob(text), out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out;
  }

  // An array is a list of numbers, a grid {from, step, count}, or 16-bit integers {q, scale, offset} in base64.
  function unpack(data) {
    if (data === null || data === undefined) return null;
    if (Array.isArray(data)) return {n: data.length, at: (i) => (data[i] === null ? NaN : data[i])};
    if ("step" in data) {
      const {from, step, count} = data;
      return {n: count, at: (i) => from + step * i, from, step};
    }
    const q = new Int16Array(bytes(data.q).buffer), {scale, offset} = data;
    return {n: q.length, at: (i) => (q[i] === NO_VALUE ? NaN : offset + scale * q[i])};
  }

  function number(value, digits = 4) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    const text = size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(digits - 1).replace(/\.?0+e/, "e")
      : String(+value.toPrecision(digits));
    return text.replace("e+", "e").replace(/-/g, "−");
  }

  function linearTicks(low, high, most) {
    const rough = (high - low) / Math.max(1, most), power = 10 ** Math.floor(Math.log10(rough));
    const steps = [0.5, 1, 2, 5, 10].map((k) => k * power), wide = steps.findIndex((k) => k >= rough * 0.999);
    const along = (step) => {
      const ticks = [];
      for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push([k * step, true]);
      return ticks;
    };
    const ticks = along(steps[wide]);
    // One or two ticks tell no scale.
    return ticks.length < 3 && wide > 0 ? along(steps[wide - 1]) : ticks;
  }

  // Words of linear ticks: all of an axis with as many decimals as tell neighbours apart.
  function tickWords(ticks) {
    if (ticks.length < 2) return (v) => number(v);
    const step = ticks[1][0] - ticks[0][0];
    const most = Math.max(Math.abs(ticks[0][0]), Math.abs(ticks[ticks.length - 1][0]));
    if (most < 1e-3 || most >= 1e6) {
      const digits = Math.max(1, Math.min(12, Math.ceil(Math.log10(most / step)) + 1));
      return (v) => (Math.abs(v) < 1e-6 * step ? "0" : number(v, digits));
    }
    const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    return (v) => (Math.abs(v) < 1e-6 * step ? "0" : v.toFixed(decimals).replace("-", "−"));
  }

  function logTicks(low, high, most) {
    const first = Math.floor(low), last = Math.ceil(high), every = Math.max(1, Math.ceil((last - first) / most));
    const ticks = [];
    for (let d = first; d <= last; d++) {
      for (const k of high - low < 4 ? [1, 2, 5] : [1]) {
        const at = d + Math.log10(k);
        if (at >= low - 1e-9 && at <= high + 1e-9) ticks.push([at, (k === 1 && d % every === 0) || high - low < 2]);
      }
    }
    return ticks.length > 1 ? ticks : linearTicks(low, high, most);
  }

  // A layer with its arrays unpacked, in the coordinates of its axes (logarithms where an axis is logarithmic).
  function ready(layer, logX, logY) {
    const warp = (array, log) => array && (log ? {n: array.n, at: (i) => Math.log10(array.at(i))} : array);
    const out = {...layer};
    for (const key of ["x"]) if (typeof layer[key] === "object") out[key] = warp(unpack(layer[key]), logX);
    for (const key of ["y", "lo", "hi"]) if (layer[key] && typeof layer[key] === "object") out[key] = warp(unpack(layer[key]), logY);
    if (layer.t === "dots" && layer.e) out.e = unpack(layer.e);
    if (layer.t === "v" && logX) out.x = Math.log10(layer.x);
    if (layer.t === "region" && logX) [out.x0, out.x1] = [Math.log10(layer.x0), Math.log10(layer.x1)];
    if (layer.t === "h" && logY) out.y = Math.log10(layer.y);
    if (layer.t === "density") out.z = bytes(layer.z);
    return out;
  }

  // Index of the first x that is not below a value; x grows.
  function lowerBound(x, value) {
    let a = 0, b = x.n;
    while (a < b) {
      const m = (a + b) >> 1;
      if (x.at(m) < value) a = m + 1; else b = m;
    }
    return a;
  }

  const spanX = (layer) => {
    if (layer.t === "density") return [layer.x0, layer.x1];
    if (!layer.x || !layer.x.n) return null;
    let low = Infinity, high = -Infinity;
    if (layer.t === "dots" || layer.path) {
      for (let i = 0; i < layer.x.n; i++) { low = Math.min(low, layer.x.at(i)); high = Math.max(high, layer.x.at(i)); }
      return [low, high];
    }
    return [layer.x.at(0), layer.x.at(layer.x.n - 1)];
  };

  function spanY(layer, x0, x1) {
    let low = Infinity, high = -Infinity;
    const take = (v) => { if (Number.isFinite(v)) { if (v < low) low = v; if (v > high) high = v; } };
    if (layer.t === "h" && layer.fit !== false) take(layer.y);
    if (layer.t === "density") { take(layer.y0); take(layer.y1); }
    if ((layer.t === "line" || layer.t === "band" || layer.t === "dots") && layer.fit !== false) {
      const whole = layer.t === "dots" || layer.path;
      const a = whole ? 0 : Math.max(0, lowerBound(layer.x, x0) - 1), b = whole ? layer.x.n : Math.min(layer.x.n, lowerBound(layer.x, x1) + 1);
      for (let i = a; i < b; i++) {
        if (whole && (layer.x.at(i) < x0 || layer.x.at(i) > x1)) continue;
        if (layer.t === "band") { take(layer.lo.at(i)); take(layer.hi.at(i)); continue; }
        const v = layer.y.at(i), e = layer.e ? layer.e.at(i) : 0;
        take(v - e); take(v + e);
      }
    }
    return low <= high ? [low, high] : null;
  }

  // Path of a line; where more than two samples share a pixel, first, lowest, highest and last of the pixel.
  function linePath(x, y, sx, sy, x0, x1, width) {
    const a = Math.max(0, lowerBound(x, x0) - 1), b = Math.min(x.n, lowerBound(x, x1) + 1);
    const parts = [];
    let pen = false;
    const point = (px, v) => { parts.push((pen ? "L" : "M") + px.toFixed(1) + " " + sy(v).toFixed(1)); pen = true; };
    if (b - a <= 3 * width) {
      for (let i = a; i < b; i++) {
        const v = y.at(i);
        if (Number.isFinite(v)) point(sx(x.at(i)), v); else pen = false;
      }
      return parts.join("");
    }
    let column = null, first = 0, last = 0, low = 0, high = 0, lowFirst = true;
    const flush = () => {
      if (column === null) return;
      const px = column + 0.5;
      point(px, first);
      if (high > low) { point(px, lowFirst ? low : high); point(px, lowFirst ? high : low); point(px, last); }
      column = null;
    };
    for (let i = a; i < b; i++) {
      const v = y.at(i);
      if (!Number.isFinite(v)) { flush(); pen = false; continue; }
      const c = Math.floor(sx(x.at(i)));
      if (c !== column) { flush(); column = c; first = last = low = high = v; continue; }
      last = v;
      if (v < low) { low = v; lowFirst = false; }
      if (v > high) { high = v; lowFirst = true; }
    }
    flush();
    return parts.join("");
  }

  const plainPath = (x, y, sx, sy) => {
    let text = "";
    for (let i = 0; i < x.n; i++) text += (i ? "L" : "M") + sx(x.at(i)).toFixed(1) + " " + sy(y.at(i)).toFixed(1);
    return text;
  };

  function bandPath(layer, sx, sy, x0, x1) {
    const a = Math.max(0, lowerBound(layer.x, x0) - 1), b = Math.min(layer.x.n, lowerBound(layer.x, x1) + 1);
    let text = "", run = [];
    const close = () => {
      if (run.length > 1) {
        text += "M" + run.map(([px, , hi]) => px + " " + hi).join("L") + "L" + run.reverse().map(([px, lo]) => px + " " + lo).join("L") + "Z";
      }
      run = [];
    };
    for (let i = a; i < b; i++) {
      const lo = layer.lo.at(i), hi = layer.hi.at(i);
      if (!Number.isFinite(lo) || !Number.isFinite(hi)) { close(); continue; }
      run.push([sx(layer.x.at(i)).toFixed(1), sy(lo).toFixed(1), sy(hi).toFixed(1)]);
    }
    close();
    return text;
  }

  function densityImage(layer, colour) {
    const canvas = document.createElement("canvas");
    canvas.width = layer.nx; canvas.height = layer.ny;
    const context = canvas.getContext("2d");
    context.fillStyle = colour;
    context.fillRect(0, 0, 1, 1);
    const [r, g, b] = context.getImageData(0, 0, 1, 1).data;
    const image = context.createImageData(layer.nx, layer.ny);
    for (let i = 0; i < layer.nx; i++) {
      for (let k = 0; k < layer.ny; k++) {
        const place = 4 * ((layer.ny - 1 - k) * layer.nx + i);
        image.data.set([r, g, b, layer.z[i * layer.ny + k] * 0.85], place);
      }
    }
    context.putImageData(image, 0, 0);
    return canvas.toDataURL();
  }

  // Height of a panel, what is shown in it, its range and the ticks of its axis.
  function verticalAxis(panel, spec, state, x0, x1, width, inner) {
    const height = panel.height * (width < 480 && !spec.small ? 0.85 : 1);
    const shown = panel.ready.filter((layer) => !state.hidden.has(layer.name));
    let range = panel.range ? [...panel.range] : null;
    if (range && panel.log) range = range.map(Math.log10);
    if (!range) {
      const spans = shown.map((layer) => spanY(layer, x0, x1)).filter(Boolean);
      range = spans.length ? [Math.min(...spans.map((s) => s[0])), Math.max(...spans.map((s) => s[1]))] : [0, 1];
      if (panel.log) range[0] = Math.max(range[0], range[1] - 6);
      const pad = 0.06 * (range[1] - range[0]) || 0.05 * Math.abs(range[0]) || 0.5;
      range = [range[0] - pad, range[1] + pad];
    }
    if (spec.equal) {
      const need = ((x1 - x0) / inner) * height, middle = 0.5 * (range[0] + range[1]);
      range = [middle - 0.5 * need, middle + 0.5 * need];
    }
    const ticks = (panel.log ? logTicks : linearTicks)(...range, height / 26);
    return {height, shown, range, ticks, words: panel.log ? (v) => number(10 ** v, 3) : tickWords(ticks)};
  }

  // Linear ticks so far apart that their words do not touch.
  function apart(low, high, inner, gap) {
    let ticks = [];
    for (; gap <= inner; gap *= 1.25) {
      ticks = linearTicks(low, high, inner / gap);
      const words = tickWords(ticks), room = ticks.length > 1 ? ((ticks[1][0] - ticks[0][0]) / (high - low)) * inner : inner;
      if (DIGIT * Math.max(...ticks.map(([v]) => words(v).length)) + 6 <= room) return ticks;
    }
    return ticks.length > 2 ? ticks.filter((_, k) => k % 2 === 0) : ticks;
  }

  function draw(host, spec, state, wanted) {
    const width = Math.max(200, Math.round(wanted || host.clientWidth || 640));
    if (spec.kind === "matrix") return drawMatrix(host, spec, width);
    const small = Boolean(spec.small), {names} = spec.x, least = small ? 60 : LEFT;
    const bottom = names ? Math.min(120, 30 + 5.5 * Math.max(...names.map((name) => name.length))) : small ? 34 : BOTTOM;
    const logX = Boolean(spec.x.log);
    if (!spec.prepared) {
      for (const panel of spec.panels) panel.ready = panel.layers.map((layer) => ready(layer, logX, panel.log));
      spec.prepared = true;
    }
    let full = spec.x.range ? spec.x.range.map((v) => (logX ? Math.log10(v) : v)) : null;
    if (!full) {
      const spans = spec.panels.flatMap((panel) => panel.ready.map(spanX)).filter((s) => s && s.every(Number.isFinite));
      full = spans.length ? [Math.min(...spans.map((s) => s[0])), Math.max(...spans.map((s) => s[1]))] : [0, 1];
      if (full[0] === full[1]) full = [full[0] - 0.5, full[1] + 0.5];
    }
    const [x0, x1] = state.view || full;
    const axes = spec.panels.map((panel) => verticalAxis(panel, spec, state, x0, x1, width, width - least - RIGHT));
    // Room for the widest number beside the words of its axis.
    const left = spec.equal ? least : Math.max(least, ...axes.map(({ticks, words}) => Math.ceil(29 + DIGIT * Math.max(0, ...ticks.map(([v, label]) => (label ? words(v).length : 0))))));
    const inner = width - left - RIGHT, sx = (v) => left + ((v - x0) / (x1 - x0)) * inner;
    const geometry = [];
    let y = TOP, body = "";
    // Words longer than their axis stand above it.
    const above = spec.panels.some((panel) => panel.label.length * 6.3 > panel.height);
    for (const panel of spec.panels) {
      if (above) y += 17;
      const {height, shown, range: [y0, y1], ticks, words} = axes[spec.panels.indexOf(panel)], top = y;
      const sy = (v) => top + height - ((v - y0) / (y1 - y0)) * height;
      const clip = `clip${++clips}`;
      for (const [v, label] of ticks) {
        const py = sy(v).toFixed(1);
        body += `<line class="grid" x1="${left}" x2="${left + inner}" y1="${py}" y2="${py}"/>`;
        if (label) body += `<text class="tick" x="${left - 6}" y="${py}" dy=".32em" text-anchor="end">${words(v)}</text>`;
      }
      // Names stand at whole numbers, as many as fit.
      const every = names && Math.ceil((12 * (x1 - x0)) / inner);
      const ticksX = names ? names.map((_, i) => [i, i % every === 0]) : logX ? logTicks(x0, x1, inner / (small ? 48 : 72)) : apart(x0, x1, inner, small ? 48 : 72);
      const xTicks = ticksX.filter(([v]) => v >= x0 && v <= x1);
      const xWords = logX ? (v) => number(10 ** v, 3) : tickWords(xTicks);
      const lowest = panel === spec.panels[spec.panels.length - 1];
      for (const [v, label] of xTicks) {
        const px = sx(v).toFixed(1);
        body += `<line class="grid" x1="${px}" x2="${px}" y1="${top}" y2="${top + height}"/>`;
        if (lowest && label && names) body += `<text class="tick" transform="translate(${px} ${top + height + 8}) rotate(-60)" text-anchor="end" dy=".32em">${escape(names[v])}</text>`;
        else if (lowest && label) body += `<text class="tick" x="${px}" y="${top + height + 15}" text-anchor="middle">${xWords(v)}</text>`;
      }
      if (y0 < 0 && y1 > 0 && !panel.log) body += `<line class="zero" x1="${left}" x2="${left + inner}" y1="${sy(0).toFixed(1)}" y2="${sy(0).toFixed(1)}"/>`;
      body += `<clipPath id="${clip}"><rect x="${left}" y="${top}" width="${inner}" height="${height}"/></clipPath><g clip-path="url(#${clip})">`;
      for (const layer of shown) body += drawLayer(host, layer, {sx, sy, x0, x1, y0, y1, left, inner, top, height, logX});
      body += "</g>";
      for (const layer of shown) {
        if (layer.t === "v" && layer.label && layer.x >= x0 && layer.x <= x1) {
          const end = sx(layer.x) > left + 0.7 * inner;
          body += `<text class="mark" x="${(sx(layer.x) + (end ? -4 : 4)).toFixed(1)}" y="${top + 11}" text-anchor="${end ? "end" : "start"}">${escape(layer.label)}</text>`;
        }
      }
      body += `<rect class="frame" x="${left}" y="${top}" width="${inner}" height="${height}"/>`;
      const middle = top + height / 2;
      const place = above ? `x="${left}" y="${top - 6}"` : `transform="translate(${small ? 11 : 13} ${middle}) rotate(-90)" text-anchor="middle"`;
      body += `<text class="axis" ${place}>${escape(panel.label)}</text>`;
      geometry.push({top, height, shown, y0, y1, log: panel.log});
      y += height + GAP;
    }
    const total = y - GAP + bottom;
    body += `<text class="axis" x="${left + inner / 2}" y="${total - 5}" text-anchor="middle">${escape(spec.x.label)}</text>`;
    body += `<line class="cross" x1="0" x2="0" y1="${TOP}" y2="${y - GAP}" visibility="hidden"/><rect class="pick" height="${y - GAP - TOP}" y="${TOP}" width="0" visibility="hidden"/>`;
    host.innerHTML = `<svg viewBox="0 0 ${width} ${total}" role="img" aria-label="${escape(spec.label || "")}">${body}</svg>`;
    return {svg: host.firstChild, full, view: [x0, x1], left, inner, geometry, logX, width, toX: (px) => x0 + ((px - left) / inner) * (x1 - x0), sx};
  }

  function drawLayer(host, layer, g) {
    const colour = `style="--c:var(--c-${layer.c})"`;
    if (layer.t === "line") {
      const path = layer.path ? plainPath(layer.x, layer.y, g.sx, g.sy) : linePath(layer.x, layer.y, g.sx, g.sy, g.x0, g.x1, g.inner);
      return path && `<path class="line" ${colour} d="${path}" stroke-width="${layer.w || 1.3}"${layer.d ? ` stroke-dasharray="${layer.d}"` : ""}/>`;
    }
    if (layer.t === "band") {
      const path = bandPath(layer, g.sx, g.sy, g.x0, g.x1);
      return path && `<path class="band" ${colour} d="${path}"/>`;
    }
    if (layer.t === "dots") {
      let text = "", bars = "";
      for (let i = 0; i < layer.x.n; i++) {
        const v = layer.y.at(i), px = g.sx(layer.x.at(i)).toFixed(1);
        if (!Number.isFinite(v) || layer.x.at(i) < g.x0 || layer.x.at(i) > g.x1) continue;
        const e = layer.e ? layer.e.at(i) : 0;
        if (e > 0) bars += `M${px} ${g.sy(v - e).toFixed(1)}V${g.sy(v + e).toFixed(1)}`;
        text += `<circle class="dot" ${colour} cx="${px}" cy="${g.sy(v).toFixed(1)}" r="${layer.r || 2.4}"/>`;
      }
      return (bars && `<path class="line" ${colour} d="${bars}" stroke-width="1.2"/>`) + text;
    }
    if (layer.t === "density") {
      const value = getComputedStyle(host).getPropertyValue(`--c-${layer.c}`).trim() || "#0072b2";
      const px = g.sx(layer.x0), py = g.sy(layer.y1);
      return `<image href="${densityImage(layer, value)}" x="${px.toFixed(1)}" y="${py.toFixed(1)}" width="${(g.sx(layer.x1) - px).toFixed(1)}" height="${(g.sy(layer.y0) - py).toFixed(1)}" preserveAspectRatio="none" class="density"/>`;
    }
    if (layer.t === "region") {
      const a = Math.max(g.left, g.sx(layer.x0)), b = Math.min(g.left + g.inner, g.sx(layer.x1));
      const top = layer.share ? g.top + g.height * (1 - layer.share) : g.top;
      return b > a ? `<rect class="region" ${colour} x="${a.toFixed(1)}" width="${(b - a).toFixed(1)}" y="${top}" height="${g.top + g.height - top}" fill-opacity="${layer.o || 0.1}"/>` : "";
    }
    if (layer.t === "h") return `<path class="line" ${colour} d="M${g.left} ${g.sy(layer.y).toFixed(1)}H${g.left + g.inner}" stroke-width="1" stroke-dasharray="5 4"/>`;
    if (layer.t === "v") return layer.x < g.x0 || layer.x > g.x1 ? "" : `<path class="line" ${colour} d="M${g.sx(layer.x).toFixed(1)} ${g.top}V${g.top + g.height}" stroke-width="1" stroke-dasharray="3 3"/>`;
    return "";
  }

  function drawMatrix(host, spec, width) {
    const rows = spec.rows.length, columns = spec.columns.length;
    const label = Math.min(130, 14 + 6.6 * Math.max(...spec.rows.map((r) => r.length))) + (spec.rowLabel ? 16 : 0);
    const under = Math.min(120, 12 + 6.2 * Math.max(...spec.columns.map((r) => r.length))) + (spec.columnLabel ? 18 : 0);
    const cell = Math.min(46, (width - label - 8) / columns);
    let body = "";
    const every = Math.ceil(11 / cell);
    spec.rows.forEach((name, i) => {
      if (i % every === 0) body += `<text class="tick" x="${label - 5}" y="${(TOP + (i + 0.5) * cell).toFixed(1)}" dy=".32em" text-anchor="end">${escape(name)}</text>`;
      for (let k = 0; k < columns; k++) {
        const v = spec.z[i][k];
        const at = `x="${(label + k * cell).toFixed(2)}" y="${(TOP + i * cell).toFixed(2)}" width="${cell.toFixed(2)}" height="${cell.toFixed(2)}"`;
        const tip = `<title>${escape(name)} · ${escape(spec.columns[k])}: ${number(v, 3)}</title>`;
        if (v === null) { body += `<rect class="cell none" ${at}>${tip}</rect>`; continue; }
        const strength = Math.min(1, Math.abs(v) / spec.most);
        body += `<rect class="cell" ${at} style="--c:var(--c-${v < 0 ? "below" : "above"})" fill-opacity="${(0.85 * strength).toFixed(3)}">${tip}</rect>`;
        if (cell >= 30) body += `<text class="in" x="${(label + (k + 0.5) * cell).toFixed(1)}" y="${(TOP + (i + 0.5) * cell).toFixed(1)}" dy=".32em" text-anchor="middle">${spec.most === 1 ? (Math.abs(v) < 0.005 ? 0 : v).toFixed(2).replace("0.", ".").replace("-", "−") : number(v, 2)}</text>`;
      }
    });
    const foot = TOP + rows * cell;
    // Words aslant need more room than words in rows.
    const everyColumn = Math.ceil(14 / cell);
    spec.columns.forEach((name, k) => {
      if (k % everyColumn) return;
      const px = label + (k + 0.5) * cell;
      body += `<text class="tick" transform="translate(${px.toFixed(1)} ${(foot + 8).toFixed(1)}) rotate(-60)" text-anchor="end" dy=".32em">${escape(name)}</text>`;
    });
    if (spec.columnLabel) body += `<text class="axis" x="${label + columns * cell / 2}" y="${foot + under - 5}" text-anchor="middle">${escape(spec.columnLabel)}</text>`;
    if (spec.rowLabel) body += `<text class="axis" transform="translate(12 ${TOP + rows * cell / 2}) rotate(-90)" text-anchor="middle">${escape(spec.rowLabel)}</text>`;
    body += `<rect class="frame" x="${label}" y="${TOP}" width="${columns * cell}" height="${rows * cell}"/>`;
    host.innerHTML = `<svg viewBox="0 0 ${width} ${Math.round(foot + under)}" role="img" aria-label="${escape(spec.label || "")}">${body}</svg>`;
    return null;
  }

  return {draw, number, escape, unpack, lowerBound, linearTicks, tickWords};
})();
