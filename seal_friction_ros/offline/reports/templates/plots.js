// Draws the figures of a page from their data (plot_data.py): zoom, pan, values under the pointer, linked axes.
// Without this script the page shows the same figures as pictures.
'use strict';
(() => {
  const SVG = 'http://www.w3.org/2000/svg';
  const NARROW = 640; // [px] below it panels are stacked
  const FONT = 12; // [px] of all text in a figure
  const NEAR = 24; // [px] from the pointer to a dot that is read
  const views = new Map(); // name of an axis -> its limits, shared by all panels that have it
  const figures = [];
  let count = 0;

  const make = (name, attributes = {}, parent = null, text = null) => {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text !== null) element.textContent = text;
    if (parent) parent.appendChild(element);
    return element;
  };
  const html = (name, className, parent, text = null) => {
    const element = document.createElement(name);
    element.className = className;
    if (text !== null) element.textContent = text;
    parent.appendChild(element);
    return element;
  };
  const numbers = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const pen = document.createElement('canvas').getContext('2d');
  const widthOf = (text) => { pen.font = `${FONT}px system-ui, 'DejaVu Sans', sans-serif`; return pen.measureText(text).width; };
  const sign = (text) => text.replace('-', '\u2212');

  // -- axes ----------------------------------------------------------------------------------------------------------

  const viewOf = (axis, figure, name) => {
    const shown = axis.limits.map((limit) => limit.toPrecision(2)).join(' ');
    const key = axis.quantity ? `${name} ${name === 'y' ? figure + axis.group : ''}${axis.quantity} ${shown}` : `${name}${figure} ${axis.group}`;
    if (!views.has(key)) views.set(key, { limits: [...axis.limits], full: axis.limits, log: axis.log, cursor: null });
    return views.get(key);
  };
  const forward = (view, value) => (view.log ? Math.log10(value) : value);
  const backward = (view, value) => (view.log ? 10 ** value : value);
  const isZoomed = (view) => view.limits[0] !== view.full[0] || view.limits[1] !== view.full[1];
  const setView = (view, low, high) => {
    const [a, b] = view.full.map((v) => forward(view, v));
    let [c, d] = [low, high].map((v) => forward(view, v));
    if (!Number.isFinite(c) || !Number.isFinite(d) || Math.abs(d - c) < 1e-6 * Math.abs(b - a)) return;
    const [least, most] = a < b ? [a, b] : [b, a];
    const span = Math.min(Math.abs(d - c), most - least);
    let start = Math.min(Math.max(Math.min(c, d), least), most - span);
    [c, d] = a < b ? [start, start + span] : [start + span, start];
    view.limits = span >= (most - least) * (1 - 1e-9) ? [...view.full] : [backward(view, c), backward(view, d)];
  };
  const scaleView = (view, factor, middle = 0.5) => {
    const [a, b] = view.limits.map((v) => forward(view, v));
    const at = a + middle * (b - a);
    setView(view, backward(view, at - (at - a) * factor), backward(view, at + (b - at) * factor));
  };
  const shiftView = (view, share) => {
    const [a, b] = view.limits.map((v) => forward(view, v));
    setView(view, backward(view, a + share * (b - a)), backward(view, b + share * (b - a)));
  };
  const ticksOf = (view, room, least) => {
    const [a, b] = view.limits[0] < view.limits[1] ? view.limits : [...view.limits].reverse();
    if (view.log && b / a > 5) {
      const marks = b / a > 1e3 ? [1] : [1, 2, 5];
      const found = [];
      for (let e = Math.floor(Math.log10(a)); e <= Math.ceil(Math.log10(b)); e++) for (const m of marks) {
        const value = m * 10 ** e;
        if (value >= a * 0.999 && value <= b * 1.001) found.push([value, sign(String(+value.toPrecision(3)))]);
      }
      return found;
    }
    const raw = (b - a) / Math.max(1, Math.floor(room / least));
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 2.5, 5, 10].find((m) => m * power >= raw * 0.999) * power;
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (Math.abs(step / power - 2.5) < 1e-6 ? 1 : 0));
    const found = [];
    for (let i = Math.ceil(a / step - 1e-9); i * step <= b + 1e-9 * step; i++) found.push([i * step, sign((i * step).toFixed(Math.min(digits, 12)).replace(/^-0(\.0*)?$/, '0$1'))]);
    return found;
  };
  const shownNumber = (value) => sign(String(+value.toPrecision(4)));

  // -- panels --------------------------------------------------------------------------------------------------------

  class Panel {
    constructor(figure, data) {
      this.figure = figure;
      this.data = data;
      this.x = viewOf(data.x, figure.id, 'x');
      this.y = viewOf(data.y, figure.id, 'y');
      this.box = html('div', 'panel', figure.grid);
      if (data.title) html('div', 'panel-title', this.box, data.title);
      this.ylabel = html('div', 'axis-label', this.box, '');
      if (data.second) html('div', 'axis-label above', this.box, data.second.label);
      this.svg = make('svg', {}, null);
      this.box.appendChild(this.svg);
      this.xlabel = html('div', 'axis-label below', this.box, '');
      this.clip = `clip${count++}`;
      this.items = data.items.map((item) => (item.xs === undefined ? item : this.prepared(item)));
      this.listen();
    }

    prepared(item) {
      const x = this.figure.arrays[item.xs];
      const y = this.figure.arrays[item.ys];
      let sorted = item.kind === 'line' && !item.across && !item.upright && x.length > 1;
      for (let i = 1; sorted && i < x.length; i++) sorted = !(x[i] < x[i - 1]);
      return { ...item, x, y, sorted };
    }

    // A panel beside another one has its numbers there; below it, on a narrow page, it needs its own.
    get owner() { return this.figure.data.panels[this.data.y.group]; }

    get yLabelled() { return this.data.y.labelled || (this.figure.narrow && this.owner.y.labelled && this.data.height > 80); }

    get yLabel() { return (this.data.y.label || (this.yLabelled ? this.owner.y.label : '')).replace(/\s*\n\s*/g, ' '); }

    get rows() { return this.data.y.ticks && this.data.y.ticks.some(([, text]) => text.length > 6) ? this.data.y.ticks : null; }

    // Lines of the labels of rows, wrapped to a share of the width.
    wrapped(width) {
      const most = 0.45 * width;
      return this.rows.map(([, text]) => {
        const lines = [''];
        for (const word of text.replace(/\n/g, ' ').split(' ')) {
          const longer = lines.at(-1) ? `${lines.at(-1)} ${word}` : word;
          if (lines.at(-1) && widthOf(longer) > most) lines.push(word); else lines[lines.length - 1] = longer;
        }
        return lines;
      });
    }

    // Height before labels of rows and an equal aspect have their say [px].
    tallness() {
      const tall = this.data.height;
      return this.figure.narrow && tall > 80 ? Math.max(150, Math.min(tall, 0.75 * this.box.clientWidth)) : tall;
    }

    leftRoom(width) {
      if (this.rows) return Math.max(...this.wrapped(width).flat().map(widthOf)) + 12;
      if (!this.yLabelled) return 0;
      const ticks = this.data.y.ticks || ticksOf(this.y, this.tallness(), 38);
      return Math.max(20, ...ticks.map(([, text]) => widthOf(text))) + 12;
    }

    at(axis, value) {
      const [a, b] = this[axis].limits.map((v) => forward(this[axis], v));
      const share = (forward(this[axis], value) - a) / (b - a);
      return axis === 'x' ? this.left + share * this.width : this.top + (1 - share) * this.height;
    }

    valueAt(axis, pixel) {
      const [a, b] = this[axis].limits.map((v) => forward(this[axis], v));
      const share = axis === 'x' ? (pixel - this.left) / this.width : 1 - (pixel - this.top) / this.height;
      return backward(this[axis], a + share * (b - a));
    }

    draw(left, showX) {
      const { data, svg } = this;
      const { narrow } = this.figure;
      const all = this.box.clientWidth;
      this.left = left;
      this.width = Math.max(all - left - 12, 40);
      this.top = data.second ? 20 : 6;
      const fixed = data.x.ticks && data.x.ticks.length;
      this.bottom = showX ? 20 : 8; // half a label of the other axis
      this.height = this.tallness();
      if (this.rows) this.height = Math.max(this.height, 17 * this.wrapped(all).flat().length);
      if (data.equal) {
        const [x, y] = [this.x.full, this.y.full];
        this.height = this.width * Math.abs((y[1] - y[0]) / (x[1] - x[0]));
        const most = 420;
        if (this.height > most) { this.width *= most / this.height; this.height = most; }
      }
      const tall = this.top + this.height + this.bottom;
      svg.replaceChildren();
      svg.setAttribute('width', all);
      svg.setAttribute('height', tall);
      svg.setAttribute('viewBox', `0 0 ${all} ${tall}`);
      const clip = make('clipPath', { id: this.clip }, make('defs', {}, svg));
      make('rect', { x: this.left, y: this.top, width: this.width, height: this.height }, clip);
      this.xlabel.textContent = showX ? data.x.label || this.figure.labelBelow(this) : '';
      const inRow = this.figure.panels.some((one) => one.data.row === data.row && one.data.y.labelled && one.data.y.label);
      this.ylabel.textContent = this.yLabelled && this.yLabel ? this.yLabel : inRow && !narrow ? '\u00a0' : ''; // so that they align
      this.ylabel.style.display = this.ylabel.textContent ? '' : 'none';
      this.xlabel.style.display = this.xlabel.textContent ? '' : 'none';
      this.drawGrid(all, showX, fixed);
      const inside = make('g', { 'clip-path': `url(#${this.clip})` }, svg);
      this.texts = [];
      for (const item of this.items) {
        if (this.figure.hidden.has(item.name)) continue;
        if (item.kind === 'line') this.drawLine(inside, item);
        else if (item.kind === 'area') this.drawArea(inside, item);
        else if (item.kind === 'arrow') this.drawArrow(inside, item);
        else if (item.kind === 'text') this.drawText(inside, item);
      }
      make('path', { d: `M${this.left} ${this.top}V${this.top + this.height}H${this.left + this.width}`, class: 'frame' }, svg);
      this.cursor = make('line', { y1: this.top, y2: this.top + this.height, class: 'cursor', visibility: 'hidden' }, svg);
      this.dots = make('g', {}, svg);
      this.band = make('rect', { class: 'band', visibility: 'hidden' }, svg);
    }

    drawGrid(all, showX, fixed) {
      const { data, svg } = this;
      const bottom = this.top + this.height;
      let end = -Infinity;
      const xticks = data.x.ticks || ticksOf(this.x, this.width, narrowText(this.x) + 26);
      for (const [value, text] of xticks) {
        const x = this.at('x', value);
        if (x < this.left - 0.5 || x > this.left + this.width + 0.5) continue;
        if (!fixed && data.x.ticks === null) make('line', { x1: x, x2: x, y1: this.top, y2: bottom, class: 'grid' }, svg);
        const half = widthOf(text) / 2;
        const middle = Math.min(Math.max(x, half), all - half);
        if (!showX || middle - half < end + 6) continue;
        end = middle + half;
        make('text', { x: middle, y: bottom + 15, 'text-anchor': 'middle' }, svg, text);
      }
      if (data.second) {
        const [a, b] = data.second.limits;
        const [from, to] = this.x.full;
        const limits = this.x.limits.map((v) => a + ((v - from) / (to - from)) * (b - a));
        for (const [value, text] of ticksOf({ limits, log: false }, this.width, 60)) {
          const x = this.left + ((value - limits[0]) / (limits[1] - limits[0])) * this.width;
          const half = widthOf(text) / 2;
          make('text', { x: Math.min(Math.max(x, half), all - half), y: 13, 'text-anchor': 'middle' }, svg, text);
        }
      }
      const lines = this.rows ? this.wrapped(all) : null;
      const yticks = data.y.ticks || ticksOf(this.y, this.height, 38);
      yticks.forEach(([value, text], i) => {
        const y = this.at('y', value);
        if (y < this.top - 0.5 || y > bottom + 0.5) return;
        if (!lines) make('line', { x1: this.left, x2: this.left + this.width, y1: y, y2: y, class: 'grid' }, svg);
        if (!this.yLabelled) return;
        const shown = lines ? lines[i] : [text];
        shown.forEach((line, k) => make('text', {
          x: this.left - 6, y: Math.max(y + 4 + 14 * (k - (shown.length - 1) / 2), 11), 'text-anchor': 'end',
        }, svg, line));
      });
    }

    places(item) {
      const px = item.across ? (v) => this.left + v * this.width : (v) => this.at('x', v);
      const py = item.upright ? (v) => this.top + (1 - v) * this.height : (v) => this.at('y', v);
      return [px, py];
    }

    // A line through the first, lowest, highest and last point of each column of pixels.
    drawLine(parent, item) {
      const { x, y } = item;
      const [px, py] = this.places(item);
      const opacity = { 'stroke-opacity': item.opacity, 'fill-opacity': item.opacity };
      if (item.width > 0) {
        const parts = [];
        let pending = null;
        let down = false;
        const put = (p) => { parts.push(`${down ? 'L' : 'M'}${p[0].toFixed(1)} ${p[1].toFixed(1)}`); down = true; };
        const flush = () => {
          if (!pending) return;
          const { low, high, last, first } = pending;
          const middle = low.i < high.i ? [low, high] : [high, low];
          for (const p of [...new Set([first, ...middle, last])]) put(p);
          pending = null;
        };
        const [most, least] = [this.left + 3 * this.width, this.left - 2 * this.width];
        for (let i = 0; i < x.length; i++) {
          if (Number.isNaN(x[i]) || Number.isNaN(y[i])) { flush(); down = false; continue; }
          const p = [Math.min(Math.max(px(x[i]), least), most), Math.min(Math.max(py(y[i]), -9999), 9999)];
          p.i = i;
          const column = Math.round(p[0]);
          if (!pending || pending.column !== column) { flush(); pending = { column, first: p, low: p, high: p, last: p }; continue; }
          if (p[1] < pending.low[1]) pending.low = p;
          if (p[1] > pending.high[1]) pending.high = p;
          pending.last = p;
        }
        flush();
        make('path', { d: parts.join(''), fill: 'none', stroke: item.colour, 'stroke-width': item.width, 'stroke-dasharray': item.dash, 'stroke-linejoin': 'round', ...opacity }, parent);
      }
      if (!item.marker) return;
      const r = item.size / 2;
      const shapes = {
        s: (a, b) => `M${a - r} ${b - r}h${2 * r}v${2 * r}h${-2 * r}Z`,
        D: (a, b) => `M${a - r} ${b}l${r} ${-r}l${r} ${r}l${-r} ${r}Z`,
        x: (a, b) => `M${a - r} ${b - r}l${2 * r} ${2 * r}m0 ${-2 * r}l${-2 * r} ${2 * r}`,
        _: (a, b) => `M${a - r} ${b}h${2 * r}`,
        o: (a, b) => `M${a.toFixed(1)} ${b.toFixed(1)}h0`,
      };
      const shape = shapes[item.marker] || shapes.o;
      let d = '';
      for (let i = 0; i < x.length; i++) {
        const [a, b] = [px(x[i]), py(y[i])];
        if (a > this.left - 20 && a < this.left + this.width + 20 && b > -20 && b < this.top + this.height + 20) d += shape(Math.round(10 * a) / 10, Math.round(10 * b) / 10);
      }
      const round = shape === shapes.o;
      const stroke = round ? { 'stroke-width': item.size, 'stroke-linecap': 'round', fill: 'none', stroke: item.colour }
        : { 'stroke-width': item.empty ? 1.4 : 1.6, fill: item.empty || 'x_'.includes(item.marker) ? 'none' : item.colour, stroke: item.empty || 'x_'.includes(item.marker) ? item.colour : 'none' };
      make('path', { d, ...stroke, ...opacity }, parent);
    }

    drawArea(parent, item) {
      const [px, py] = this.places(item);
      const { x, y } = item;
      const near = (v) => Math.min(Math.max(v, -20000), 20000).toFixed(1);
      let d = '';
      let open = false;
      for (let i = 0; i < x.length; i++) {
        if (Number.isNaN(x[i]) || Number.isNaN(y[i])) { d += open ? 'Z' : ''; open = false; continue; }
        d += `${open ? 'L' : 'M'}${near(px(x[i]))} ${near(py(y[i]))}`;
        open = true;
      }
      make('path', { d: d + (open ? 'Z' : ''), fill: item.colour, 'fill-opacity': item.opacity, stroke: item.edge || 'none', 'stroke-width': item.seamless ? 0.6 : 1 }, parent);
    }

    drawArrow(parent, item) {
      const [a, b, c, e] = item.ends;
      const [x, y] = [this.at('x', c), this.at('y', e)];
      const angle = (Math.atan2(y - this.at('y', b), x - this.at('x', a)) * 180) / Math.PI;
      make('path', { d: 'M6 0L-6 -5V5Z', transform: `translate(${x} ${y}) rotate(${angle})`, fill: item.colour }, parent);
    }

    drawText(parent, item) {
      const half = widthOf(item.text) / 2;
      const shift = { start: 0, middle: -half, end: -2 * half }[item.anchor];
      let x = this.at('x', item.at[0]) + item.offset[0];
      x = Math.min(x, this.left + this.width - 2 * half - shift - 2);
      const y = this.at('y', item.at[1]) + item.offset[1];
      const box = [x + shift - 2, x + shift + 2 * half + 2];
      if (this.texts.some(([p, q, r]) => p < box[1] && q > box[0] && Math.abs(r - y) < 13)) return;
      this.texts.push([...box, y]);
      make('text', { x, y, 'text-anchor': item.anchor, 'dominant-baseline': item.baseline, fill: item.colour }, parent, item.text);
    }

    // -- values under the pointer, zoom and pan -----------------------------------------------------------------------

    listen() {
      const { svg } = this;
      svg.addEventListener('pointermove', (event) => this.move(event));
      svg.addEventListener('pointerleave', () => this.leave());
      svg.addEventListener('pointerdown', (event) => this.press(event));
      svg.addEventListener('pointerup', (event) => this.release(event));
      svg.addEventListener('pointercancel', () => { this.start = null; });
      svg.addEventListener('dblclick', () => this.figure.reset());
      svg.addEventListener('wheel', (event) => {
        if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
        event.preventDefault();
        scaleView(this.x, event.deltaY > 0 ? 1.25 : 0.8, (this.spot(event)[0] - this.left) / this.width);
        redraw(this.x);
      }, { passive: false });
    }

    spot(event) {
      const box = this.svg.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    }

    press(event) {
      if (event.button !== 0) return;
      const [x, y] = this.spot(event);
      this.start = { x, y, pan: event.shiftKey || event.pointerType === 'touch', last: [x, y] };
      if (event.pointerType !== 'touch') this.svg.setPointerCapture(event.pointerId);
    }

    move(event) {
      const [x, y] = this.spot(event);
      if (!this.start) { this.read(x, y); return; }
      if (this.start.pan) {
        if (isZoomed(this.x)) shiftView(this.x, (this.start.last[0] - x) / this.width);
        if (isZoomed(this.y) && event.shiftKey) shiftView(this.y, (y - this.start.last[1]) / this.height);
        this.start.last = [x, y];
        redraw(this.x, this.y);
        if (!isZoomed(this.x)) this.read(x, y);
        return;
      }
      const [left, right, top, bottom] = this.chosen(x, y);
      for (const [key, value] of Object.entries({ x: left, y: top, width: right - left, height: bottom - top, visibility: 'visible' })) this.band.setAttribute(key, value);
    }

    // The part that is dragged over: of one axis alone, if the other is hardly moved.
    chosen(x, y) {
      const { start } = this;
      let [left, right] = [Math.min(start.x, x), Math.max(start.x, x)];
      let [top, bottom] = [Math.min(start.y, y), Math.max(start.y, y)];
      if (bottom - top < 16 && right - left >= 6) [top, bottom] = [this.top, this.top + this.height];
      else if (right - left < 16 && bottom - top >= 6) [left, right] = [this.left, this.left + this.width];
      if (this.data.equal) bottom = top + ((right - left) * this.height) / this.width;
      return [Math.max(left, this.left), Math.min(right, this.left + this.width), Math.max(top, this.top), Math.min(bottom, this.top + this.height)];
    }

    release(event) {
      const { start } = this;
      if (!start) return;
      const [x, y] = this.spot(event);
      if (!start.pan && Math.hypot(x - start.x, y - start.y) > 5) {
        const [left, right, top, bottom] = this.chosen(x, y);
        const wide = [this.valueAt('x', left), this.valueAt('x', right)];
        const tall = [this.valueAt('y', bottom), this.valueAt('y', top)];
        if (right - left < this.width - 1) setView(this.x, ...wide);
        if (bottom - top < this.height - 1) setView(this.y, ...tall);
        redraw(this.x, this.y);
      }
      this.start = null;
      this.band.setAttribute('visibility', 'hidden');
    }

    leave() {
      if (this.start) return;
      this.figure.tip.hidden = true;
      this.dots.replaceChildren();
      showCursor(this.x, null);
    }

    read(x, y) {
      this.dots.replaceChildren();
      if (x < this.left - 4 || x > this.left + this.width + 4) { this.leave(); return; }
      const value = this.valueAt('x', x);
      const found = [];
      for (const item of this.items) {
        if (item.kind !== 'line' || item.across || item.upright || this.figure.hidden.has(item.name) || item.x.length < 2) continue;
        const at = item.sorted ? nearestInOrder(item, value) : this.nearest(item, x, y);
        if (at === null) continue;
        const [a, b] = [this.at('x', item.x[at]), this.at('y', item.y[at])];
        if (item.sorted && Math.abs(a - x) > 40) continue;
        found.push({ item, at, a, b, far: item.sorted ? 0 : Math.hypot(a - x, b - y) });
      }
      for (const row of this.items) { // a strip of states says the state
        if (row.kind !== 'area' || !row.name || row.across || row.upright || this.data.y.labelled) continue;
        if (contains(row, value)) found.push({ item: row, at: null, far: 0 });
      }
      const dots = found.filter((one) => one.at !== null && !one.item.sorted).sort((p, q) => p.far - q.far).slice(0, 1);
      const shown = [...found.filter((one) => one.at === null || one.item.sorted), ...dots].slice(0, 8);
      showCursor(this.x, value);
      const tip = this.figure.tip;
      if (!shown.length) { tip.hidden = true; return; }
      tip.replaceChildren();
      const label = this.data.x.label || this.data.x.quantity || 'x';
      html('div', 'tip-x', tip, `${shownNumber(shown[0].at === null || shown[0].item.sorted ? value : shown[0].item.x[shown[0].at])}  ${label}`);
      for (const { item, at, a, b } of shown) {
        const line = html('div', '', tip);
        html('i', '', line).style.background = item.colour;
        const name = item.name || this.yLabel || this.owner.y.label || 'value';
        line.append(at === null ? name : `${shownNumber(item.y[at])}  ${name}`);
        if (at !== null) make('circle', { cx: a, cy: b, r: 3.5, fill: item.colour, stroke: '#fff' }, this.dots);
      }
      tip.hidden = false;
      const place = this.figure.box.getBoundingClientRect();
      const own = this.svg.getBoundingClientRect();
      const right = own.left - place.left + x + 14;
      tip.style.left = `${Math.max(0, right + tip.offsetWidth > place.width ? right - tip.offsetWidth - 28 : right)}px`;
      tip.style.top = `${own.top - place.top + Math.max(0, Math.min(y, this.height) - tip.offsetHeight / 2)}px`;
    }

    nearest(item, x, y) {
      let best = null;
      let least = NEAR;
      for (let i = 0; i < item.x.length; i++) {
        const far = Math.hypot(this.at('x', item.x[i]) - x, this.at('y', item.y[i]) - y);
        if (far < least) { least = far; best = i; }
      }
      return best;
    }
  }

  const narrowText = (view) => Math.max(...view.limits.map((limit) => widthOf(shownNumber(limit))));
  const nearestInOrder = (item, value) => {
    const { x, y } = item;
    let [low, high] = [0, x.length - 1];
    while (high - low > 1) { const middle = (low + high) >> 1; if (x[middle] <= value) low = middle; else high = middle; }
    const best = Math.abs(x[low] - value) <= Math.abs(x[high] - value) ? low : high;
    return Number.isNaN(y[best]) || Number.isNaN(x[best]) ? null : best;
  };
  const contains = (item, value) => {
    for (let i = 0; i + 1 < item.x.length; i += 5) if (item.x[i] <= value && value < item.x[i + 1]) return true;
    return false;
  };
  const showCursor = (view, value) => {
    for (const figure of figures) for (const panel of figure.panels) {
      if (panel.x !== view || !panel.cursor) continue;
      const x = value === null ? 0 : panel.at('x', value);
      panel.cursor.setAttribute('visibility', value === null ? 'hidden' : 'visible');
      panel.cursor.setAttribute('x1', x);
      panel.cursor.setAttribute('x2', x);
    }
  };
  const redraw = (...changed) => {
    for (const figure of figures) if (figure.panels.some((panel) => changed.includes(panel.x) || changed.includes(panel.y))) figure.draw();
  };

  // -- figures -------------------------------------------------------------------------------------------------------

  class Figure {
    constructor(element) {
      const data = JSON.parse(element.querySelector('script').textContent);
      this.id = element.id;
      this.data = data;
      this.hidden = new Set();
      this.arrays = data.arrays.map(numbers);
      this.box = element.querySelector('.plot');
      this.box.hidden = false;
      this.box.tabIndex = 0;
      this.box.setAttribute('role', 'group');
      this.box.setAttribute('aria-label', `${data.title || element.id}: plus and minus zoom, arrows pan, 0 shows everything`);
      const head = html('div', 'plot-head', this.box);
      html('h4', '', head, data.title);
      const buttons = html('div', 'plot-buttons', head);
      for (const [text, title, act] of [['+', 'zoom in', () => this.scale(0.5)], ['\u2212', 'zoom out', () => this.scale(2)], ['all', 'show everything', () => this.reset()]]) {
        const button = html('button', '', buttons, text);
        button.type = 'button';
        button.title = title;
        button.setAttribute('aria-label', title);
        button.addEventListener('click', act);
      }
      this.legend();
      this.grid = html('div', 'panels', this.box);
      this.tip = html('div', 'tip', this.box);
      this.tip.hidden = true;
      this.panels = data.panels.map((panel) => new Panel(this, panel));
      if (data.scale) this.scaleBar(data.scale);
      this.box.addEventListener('keydown', (event) => this.key(event));
      figures.push(this);
      this.draw();
    }

    legend() {
      if (!this.data.legend.length) return;
      const box = html('div', 'legend', this.box);
      for (const entry of this.data.legend) {
        const button = html('button', '', box);
        button.type = 'button';
        button.title = 'show or hide';
        const swatch = make('svg', { width: 22, height: 12, 'aria-hidden': 'true' });
        button.appendChild(swatch);
        const paint = { stroke: entry.colour, 'stroke-width': 2, 'stroke-dasharray': entry.dash };
        if (entry.kind === 'line') make('line', { x1: 1, x2: 21, y1: 6, y2: 6, ...paint }, swatch);
        else if (entry.kind === 'dots') make('circle', { cx: 11, cy: 6, r: entry.opacity < 1 ? 3 : 4, fill: entry.colour, 'fill-opacity': entry.opacity }, swatch);
        else make('rect', { x: 3, y: 1, width: 16, height: 10, fill: entry.colour, 'fill-opacity': Math.max(entry.opacity, 0.3) }, swatch);
        button.append(entry.name);
        button.setAttribute('aria-pressed', 'true');
        button.addEventListener('click', () => {
          if (!this.hidden.delete(entry.name)) this.hidden.add(entry.name);
          button.setAttribute('aria-pressed', String(!this.hidden.has(entry.name)));
          this.draw();
        });
      }
    }

    scaleBar(scale) {
      const box = html('div', 'scale', this.box);
      html('span', '', box, shownNumber(scale.limits[0]));
      html('i', '', box).style.background = `linear-gradient(to right, ${scale.colours.join(', ')})`;
      html('span', '', box, `${shownNumber(scale.limits[1])}  ${scale.label}`);
    }

    get byColumns() { // a panel without a title belongs to the one above it
      return this.data.panels.some((panel) => panel.row > 0 && !panel.title) || new Set(this.data.panels.map((panel) => panel.x.group)).size === this.data.columns;
    }

    labelBelow(panel) { // of the panel that has the label of a shared axis
      const owner = this.panels.find((one) => one.x === panel.x && one.data.x.label && one.data.x.group === panel.data.x.group);
      return owner ? owner.data.x.label : '';
    }

    draw() {
      const width = this.box.clientWidth;
      this.narrow = width < NARROW;
      const columns = this.narrow ? 1 : this.data.columns;
      this.grid.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
      const lefts = new Map();
      const columnOf = (panel) => (this.narrow ? 0 : panel.data.column);
      for (const panel of this.panels) {
        panel.box.style.order = this.narrow && this.byColumns ? 1000 * panel.data.column + panel.data.row : 1000 * panel.data.row + panel.data.column;
        if (!this.narrow) { panel.box.style.gridColumn = `${panel.data.column + 1} / span ${panel.data.span}`; panel.box.style.gridRow = panel.data.row + 1; }
        else { panel.box.style.gridColumn = ''; panel.box.style.gridRow = ''; }
        lefts.set(columnOf(panel), Math.max(lefts.get(columnOf(panel)) || 0, panel.leftRoom(width / columns)));
      }
      for (const panel of this.panels) {
        const below = this.panels.some((one) => one.data.x.group === panel.data.x.group && one.data.column === panel.data.column && one.data.row > panel.data.row);
        const stacked = !this.narrow || this.byColumns || this.data.columns === 1;
        panel.draw(Math.min(lefts.get(columnOf(panel)), 0.5 * width), panel.data.x.ticks === null || panel.data.x.ticks.length ? !(below && stacked) : false);
      }
    }

    get views() { return [...new Set(this.panels.map((panel) => panel.x))]; }

    scale(factor) { this.views.forEach((view) => scaleView(view, factor)); redraw(...this.views); }

    reset() {
      const all = [...this.views, ...this.panels.map((panel) => panel.y)];
      all.forEach((view) => { view.limits = [...view.full]; });
      redraw(...all);
    }

    key(event) {
      const acts = {
        '+': () => this.scale(0.5), '=': () => this.scale(0.5), '-': () => this.scale(2), 0: () => this.reset(), Escape: () => this.reset(),
        ArrowLeft: () => this.pan(-0.2), ArrowRight: () => this.pan(0.2),
      };
      if (!acts[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      acts[event.key]();
    }

    pan(share) { this.views.filter(isZoomed).forEach((view) => shiftView(view, share)); redraw(...this.views); }
  }

  for (const element of document.querySelectorAll('figure[id]')) {
    try {
      new Figure(element);
    } catch (error) { // the picture says the same
      element.querySelector('.plot').innerHTML = element.querySelector('noscript').textContent;
      console.error(`${element.id}: ${error.stack}`);
    }
  }
  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if (window.innerWidth === width) return; // a phone that hides its bar
    width = window.innerWidth;
    figures.forEach((figure) => figure.draw());
  });
})();
