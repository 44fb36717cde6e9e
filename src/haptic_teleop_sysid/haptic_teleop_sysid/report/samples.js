"use strict";
// The samples of long lines: unpacked (samples.py), and drawn as many as there is room for in what is in
// view.  Used by page.js and cursor.js.
const Samples = (() => {
  const ROOM = 2000; // points of a line: about two for each pixel
  const held = new Map(); // source -> { x, y }, all that the page has of a line

  async function bytesOf(text) {
    const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  // Whole numbers from their differences, or those of the differences; high bytes before low ones.
  function summed(bytes, at, n, order) {
    const found = new Float64Array(n);
    const sums = new Array(order).fill(0);
    for (let i = 0; i < n; i++) {
      let sum = (bytes[at + i] << 8) | bytes[at + n + i];
      for (let k = 0; k < order; k++) sum = sums[k] = (sums[k] + sum) >>> 0;
      found[i] = sum;
    }
    return found;
  }

  const STEPS = 16382;

  function line(bytes, { at, n, low, high, order, start, period, jumps }) {
    const step = (high - low) / STEPS;
    const y = summed(bytes, at, n, order).map((sum) => {
      const value = sum % 65536;
      return value > STEPS ? NaN : value === STEPS ? high : low + step * value;
    });
    if (period === undefined) {
      const times = bytes.slice(at + 2 * n, at + 6 * n);
      return { x: Float64Array.from(new Float32Array(times.buffer)), y };
    }
    const index = jumps ? summed(bytes, at + 2 * n, n, 1) : y.map((_, i) => i);
    return { x: index.map((i) => start + period * i), y };
  }

  // The first sample at or behind x; times ascend.
  function from(times, x) {
    let low = 0;
    let high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < x) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  // What is drawn between two times: all samples, or the least and the greatest of each group.
  function between({ x, y }, start, end) {
    const first = Math.max(from(x, start) - 1, 0);
    const last = Math.min(from(x, end) + 1, x.length);
    if (last - first <= ROOM) return { x: x.slice(first, last), y: y.slice(first, last) };
    const size = Math.ceil((2 * (last - first)) / ROOM);
    const kept = [first];
    for (let at = first; at < last; at += size) {
      const stop = Math.min(at + size, last);
      let least = at;
      let most = at;
      for (let i = at + 1; i < stop; i++) {
        if (!(y[i] >= y[least])) if (!Number.isNaN(y[i])) least = i;
        if (!(y[i] <= y[most])) if (!Number.isNaN(y[i])) most = i;
      }
      for (const i of least < most ? [least, most] : [most, least]) if (i > kept[kept.length - 1]) kept.push(i);
    }
    if (kept[kept.length - 1] < last - 1) kept.push(last - 1);
    return { x: Float64Array.from(kept, (i) => x[i]), y: Float64Array.from(kept, (i) => y[i]) };
  }

  function draw(plots) {
    for (const plot of plots) {
      const { start, end } = plot.x_range;
      for (const each of plot.renderers) {
        const samples = held.get(each.data_source);
        if (samples) each.data_source.data = between(samples, Math.min(start, end), Math.max(start, end));
      }
    }
  }

  // Unpack the lines of some plots, and draw them, now and whenever what is in view changes.
  async function fill(plots, { bytes: packed, lines }) {
    if (!packed) return;
    const bytes = await bytesOf(packed);
    for (const plot of plots) {
      for (const each of plot.renderers) {
        const told = lines[each.data_source.id];
        if (told) held.set(each.data_source, line(bytes, told));
      }
    }
    draw(plots);
    let waiting = false;
    const soon = () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; draw(plots); });
    };
    for (const range of new Set(plots.map((plot) => plot.x_range))) range.change.connect(soon);
  }

  // All samples of a line that the page has.
  function of(source) {
    const { x, y } = held.get(source) || { x: source.get_column("x"), y: source.get_column("y") };
    return [x, y];
  }

  return { fill, of };
})();
