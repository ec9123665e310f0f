// Draws the figures of a page with uPlot, from their data (plot_data.py). Panels of the same x axis zoom together; y stays.
// A figure without data, a printed page, and a page without scripts show the pictures.
'use strict';
const figures = {}; // id -> the charts of its panels
(() => {
  const NARROW = 640; // [px] below it panels are stacked
  const FONT = '12px system-ui, "DejaVu Sans", sans-serif';
  const TURNED = { '#1a1a1a': '--ink', '#d9d9d9': '--line' }; // colours that differ in dark mode
  const panels = [];
  const pen = document.createElement('canvas').getContext('2d');
  pen.font = FONT;
  const dark = matchMedia('(prefers-color-scheme: dark)');
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = ({ colour: given, opacity }) => {
    const shown = given in TURNED ? css(TURNED[given]) : given;
    return shown + Math.round(255 * opacity).toString(16).padStart(2, '0');
  };
  const numbers = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const shown = (value) => String(+value.toPrecision(4)).replace('-', '\u2212');
  const html = (name, className, parent, text = '') => {
    const element = document.createElement(name);
    element.className = className;
    element.textContent = text;
    parent.append(element);
    return element;
  };

  // One ascending x for all curves of a panel: places of other curves are undefined, which a line passes; a gap is null.
  const merged = (columns) => {
    const axes = [...new Set(columns.map(([x]) => x))], next = axes.map(() => 0), xs = [];
    const rows = columns.map(() => []);
    for (;;) {
      let least = -1;
      axes.forEach((x, k) => { if (next[k] < x.length && (least < 0 || x[next[k]] < axes[least][next[least]])) least = k; });
      if (least < 0) break;
      const place = next[least]++;
      columns.forEach(([x, y], k) => { if (x === axes[least]) rows[k][xs.length] = Number.isNaN(y[place]) ? null : y[place]; });
      xs.push(axes[least][place]);
    }
    for (const row of rows) {
      row.length = xs.length;
      for (const order of [[...row.keys()], [...row.keys()].reverse()]) {
        let before;
        for (const k of order) if (row[k] !== undefined) before = row[k]; else if (before === null) row[k] = null;
      }
    }
    return [xs, ...rows];
  };

  const zoom = (chosen, low, high) => {
    const [first, last] = chosen.full, span = Math.min(high - low, last - first);
    if (!(span > 1e-6 * (last - first))) return;
    const min = Math.min(Math.max(low, first), last - span);
    for (const panel of panels) {
      if (panel.key !== chosen.key) continue;
      panel.range = [min, min + span];
      if (panel.isSeen) panel.follow();
      else setTimeout(() => panel.follow()); // what is seen answers first
    }
  };
  const scale = (panel, factor, middle = 0.5) => {
    const [low, high] = panel.range, at = low + middle * (high - low);
    zoom(panel, at - (at - low) * factor, at + (high - at) * factor);
  };
  const shift = (panel, share) => {
    const [low, high] = panel.range;
    zoom(panel, low + share * (high - low), high + share * (high - low));
  };

  class Panel {
    constructor(figure, data, arrays, parent) {
      Object.assign(this, { figure, data, arrays });
      this.full = [...data.x.limits].sort((a, b) => a - b);
      this.range = this.full;
      this.key = data.x.quantity ? `${data.x.quantity} ${this.full.map((v) => v.toPrecision(2))}` : figure.id;
      this.box = html('div', 'panel', parent);
      this.box.style.setProperty('--row', data.row);
      this.box.style.setProperty('--column', `${data.column} / span ${data.span}`);
      const head = html('p', 'panel-title', this.box, data.title);
      html('small', '', head, ` ${data.y.label.replace(/\s+/g, ' ')}`);
      this.note = html('small', 'resolution', head);
      panels.push(this);
    }

    get isSeen() {
      const { top, bottom } = this.box.getBoundingClientRect();
      return bottom > 0 && top < innerHeight;
    }

    follow() {
      const [min, max] = this.range, shown = this.chart.scales.x;
      if (shown.min !== min || shown.max !== max) this.chart.setScale('x', { min, max });
      this.say();
    }

    // Where a curve of lowest and highest values has no more to show.
    say() {
      const { resolution, x } = this.data, places = (this.range[1] - this.range[0]) / resolution;
      this.note.textContent = resolution && places < this.chart.width / 4
        ? ` Resolution ends: lowest and highest of every ${shown(resolution)} ${(x.quantity.match(/\[(.*?)\]/) || ['', ''])[1]}` : '';
    }

    series() {
      const all = [{ label: this.data.x.quantity || 'x', value: (_, v) => (v == null ? '' : shown(v)) }], columns = [], bands = [];
      const array = (k) => this.arrays[k], lonely = !this.data.items.some((item) => item.name);
      const add = (item, y, more) => {
        columns.push([array(item.xs ?? item.left), y]);
        all.push({ label: item.name || this.data.y.quantity || 'value', spanGaps: false, value: (_, v) => (v == null ? '' : shown(v)),
          class: item.name || (item.kind === 'curve' && lonely) ? 'named' : 'unnamed', points: { show: false }, ...more });
      };
      for (const item of this.data.items) {
        const paint = colour(item);
        if (item.kind === 'curve') {
          add(item, array(item.ys), { stroke: paint, width: item.width, dash: item.dash, ...(item.width ? {} : { paths: () => null }),
            points: { show: item.dot > 0, size: item.dot, width: 1, stroke: paint, fill: item.empty ? css('--paper') : paint } });
        } else if (item.kind === 'band') {
          bands.push({ series: [all.length, all.length + 1], fill: paint });
          add(item, array(item.high), { width: 0, stroke: paint, fill: 'transparent' });
          add({ ...item, name: '' }, array(item.low), { width: 0, stroke: 'transparent' });
        } else if (item.kind === 'boxes' && item.name) {
          item.series = all.length;
          add(item, array(item.left).map(() => NaN), { stroke: paint, value: (_, v, k, at) => (at !== null && this.covers(item, at) ? 'yes' : '') });
        }
      }
      return { all, bands, columns };
    }

    covers(item, at) {
      const x = this.chart.data[0][at], left = this.arrays[item.left], right = this.arrays[item.right];
      return left.some((begin, k) => begin <= x && x < right[k]);
    }

    // Boxes and lines across, below the curves.
    under(chart) {
      const { ctx, bbox } = chart, at = (value, axis) => chart.valToPos(value, axis, true);
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      for (const item of this.data.items) {
        ctx.fillStyle = ctx.strokeStyle = colour(item);
        if (item.kind === 'boxes' && !(item.series && !chart.series[item.series].show)) {
          const { left, right, low, high } = Object.fromEntries(['left', 'right', 'low', 'high'].map((side) => [side, this.arrays[item[side]]]));
          left.forEach((begin, k) => {
            const [x, end] = [at(begin, 'x'), at(right[k], 'x')], [top, bottom] = low ? [at(high[k], 'y'), at(low[k], 'y')] : [bbox.top, bbox.top + bbox.height];
            ctx.fillRect(x, Math.min(top, bottom), Math.max(end - x, 1), Math.abs(bottom - top));
          });
        } else if (item.kind === 'across') {
          const place = at(item.at, item.axis);
          ctx.lineWidth = item.width * devicePixelRatio;
          ctx.setLineDash(item.dash);
          ctx.beginPath();
          if (item.axis === 'y') { ctx.moveTo(bbox.left, place); ctx.lineTo(bbox.left + bbox.width, place); }
          else { ctx.moveTo(place, bbox.top); ctx.lineTo(place, bbox.top + bbox.height); }
          ctx.stroke();
        }
      }
      ctx.restore();
    }

    axis(name, narrow) {
      const data = this.data[name], own = data.labelled || (narrow && this.data.height > 80);
      const look = { font: FONT, labelFont: FONT, stroke: css('--ink'), ticks: { show: false }, grid: { stroke: css('--line'), width: 1, show: data.ticks === null } };
      if (data.ticks) {
        const texts = new Map(data.ticks);
        look.splits = () => [...texts.keys()];
        look.values = () => (own ? [...texts.values()].map((text) => text.replace(/\n/g, ' ')) : [...texts.values()].map(() => ''));
      } else look.values = (_, ticks) => ticks.map((tick) => (own && tick !== null ? shown(tick) : ''));
      if (name === 'x') return { ...look, size: own ? 26 : 8, space: 64, label: own && data.label ? data.label : undefined, labelSize: 18 };
      const room = Math.max(0, ...(data.ticks || []).map(([, text]) => pen.measureText(text.replace(/\n/g, ' ')).width));
      return { ...look, size: Math.max(own || this.data.height < 80 ? 58 : 12, Math.min(room + 14, 200)), space: 32 };
    }

    draw() {
      if (this.chart) this.chart.destroy();
      const narrow = this.figure.clientWidth < NARROW, { x, y, height, items } = this.data, { all, bands, columns } = this.series();
      const [low, high] = [...y.limits].sort((a, b) => a - b), distr = (axis) => (axis.log ? 3 : 1);
      const axes = [this.axis('x', narrow), this.axis('y', narrow)];
      const empty = !columns.length;
      if (empty) { columns.push([this.full, [NaN, NaN]]); all.push({ class: 'unnamed' }); }
      this.chart = new uPlot({
        width: this.box.clientWidth, height: height + axes[0].size + (axes[0].label ? 18 : 0) + 8, padding: [8, 12, 0, 0],
        series: all, bands, axes, legend: { show: items.some((item) => item.name) || (!empty && height > 80), markers: { width: 0, fill: (chart, k) => all[k].stroke } },
        scales: { x: { time: false, distr: distr(x), range: () => this.range }, y: { distr: distr(y), range: () => [low, high], dir: y.limits[0] > y.limits[1] ? -1 : 1 } },
        cursor: { sync: { key: this.key, setSeries: false }, drag: { x: true, y: false, setScale: false }, points: { size: 6 }, dataIdx: (chart, k, at) => this.near(chart, k, at) },
        hooks: { drawClear: [(chart) => this.under(chart)], setSelect: [(chart) => {
          const { left, width } = chart.select;
          if (width > 5) zoom(this, chart.posToVal(left, 'x'), chart.posToVal(left + width, 'x'));
          if (width) chart.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
        }] },
      }, merged(columns), this.box);
      this.chart.over.setAttribute('aria-hidden', 'true');
      for (const entry of this.box.querySelectorAll('.u-legend th')) {
        entry.tabIndex = 0;
        entry.addEventListener('keydown', (event) => { if (event.key === 'Enter') entry.click(); });
      }
      this.listen(this.chart.over);
      this.say();
    }

    // Nearest number of a curve, within 20 px.
    near(chart, k, at) {
      const x = chart.data[0], row = chart.data[k], close = (place) => Math.abs(chart.valToPos(x[place], 'x') - chart.valToPos(x[at], 'x')) < 20;
      for (let left = at, right = at; left >= 0 || right < x.length; left--, right++) {
        if (left >= 0 && row[left] != null) return close(left) ? left : at;
        if (right < x.length && row[right] != null) return close(right) ? right : at;
        if (!(left >= 0 && close(left)) && !(right < x.length && close(right))) return at;
      }
      return at;
    }

    listen(over) {
      over.addEventListener('dblclick', () => zoom(this, ...this.full));
      over.addEventListener('wheel', (event) => {
        if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
        event.preventDefault();
        scale(this, event.deltaY > 0 ? 1.25 : 0.8, event.offsetX / over.clientWidth);
      }, { passive: false });
      let apart = 0; // [px] of two fingers
      const width = ({ touches: [a, b] }) => (b ? Math.abs(a.clientX - b.clientX) : 0);
      over.addEventListener('touchstart', (event) => { apart = width(event); });
      over.addEventListener('touchmove', (event) => {
        if (!apart || !width(event)) return;
        event.preventDefault();
        scale(this, apart / Math.max(width(event), 1), ((event.touches[0].clientX + event.touches[1].clientX) / 2 - over.getBoundingClientRect().left) / over.clientWidth);
        apart = width(event);
      }, { passive: false });
    }
  }

  for (const figure of document.querySelectorAll('figure[id]')) {
    const source = figure.querySelector('script');
    if (!source) continue;
    const data = JSON.parse(source.textContent), arrays = data.arrays.map(numbers), box = figure.querySelector('.plot');
    figure.classList.add('drawn');
    box.tabIndex = 0;
    box.setAttribute('role', 'group');
    box.setAttribute('aria-label', `${data.title || figure.id}: plus and minus zoom, arrows pan, 0 shows everything`);
    html('p', 'plot-title', box, data.title);
    const grid = html('div', 'panels', box), own = data.panels.map((panel) => new Panel(figure, panel, arrays, grid));
    box.addEventListener('keydown', (event) => {
      const every = (act) => [...new Map(own.map((panel) => [panel.key, panel])).values()].forEach(act);
      const acts = {
        '+': () => every((panel) => scale(panel, 0.5)), '-': () => every((panel) => scale(panel, 2)), 0: () => every((panel) => zoom(panel, ...panel.full)),
        ArrowLeft: () => every((panel) => shift(panel, -0.2)), ArrowRight: () => every((panel) => shift(panel, 0.2)),
      };
      if (!acts[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      acts[event.key]();
    });
  }
  const draw = () => {
    for (const panel of panels) panel.draw();
    for (const { figure } of panels) figures[figure.id] = panels.filter((panel) => panel.figure === figure).map((panel) => panel.chart);
  };
  let width = innerWidth;
  addEventListener('resize', () => {
    if (innerWidth === width) return; // a phone that hides its bar
    width = innerWidth;
    draw();
  });
  dark.addEventListener('change', draw);
  draw();
})();
