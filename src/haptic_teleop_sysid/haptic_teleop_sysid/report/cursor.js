"use strict";
// What a plot tells of its values: under the mouse, and at a cursor that the keyboard moves, which a screen
// reader hears.  Used by page.js.
const Cursor = (() => {
  const KEYS = {
    ArrowLeft: "back", ArrowRight: "on", PageUp: "far back", PageDown: "far on", Home: "first", End: "last",
    "+": "in", "=": "in", "-": "out", "_": "out", 0: "reset", Escape: "reset",
  };
  const AFTER = { in: "closer", out: "wider", reset: "everything" };
  // Shares of what is in view: the least that one sees the cursor move by, and a long way.
  const STEP = 1 / 500;
  const LEAP = 1 / 10;
  const HINT = "Keys: ← → Home End read values, + − zoom, 0 shows everything";

  // The index of the sample next to x; times ascend.
  function nearest(times, x) {
    let low = 0;
    let high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] > x) high = middle;
      else low = middle;
    }
    return x - times[low] < times[high] - x ? low : high;
  }

  // As many digits as tell two values apart that differ by a step; without a step four that count.
  function number(value, step) {
    const digits = Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-3), 0), 12);
    const text = step > 0 ? value.toFixed(digits) : String(Number(value.toPrecision(4)));
    return /[1-9]/.test(text) ? text.replace("-", "−") : text.replace("-", "");
  }

  // Samples (x, y) of the lines shown, by name.
  function drawn({ plot }) {
    const found = new Map();
    for (const line of plot.renderers) {
      const [x, y] = Samples.of(line.data_source);
      if (line.visible && y && y.length && !found.has(line.name)) found.set(line.name, [x, y]);
    }
    return found;
  }

  function longest(panel) {
    return [...drawn(panel).values()].map(([x]) => x).reduce((a, b) => (b.length > a.length ? b : a), []);
  }

  // One view of a figure: panels {plot, stop, readout, axes} one below the other.  names, dated: of the
  // samples; order: of the lines in the legend; said: the element that is read out; zoom(what, about): what the
  // page does, about(range) being where.
  class Cursor {
    constructor(panels, { names, dated }, order, said, zoom) {
      Object.assign(this, { panels, names, dated, order, said, zoom, at: new Map() }); // at: x by range
      for (const panel of panels) {
        panel.line = panel.plot.center.find((model) => model.name === "cursor");
        panel.plot.on_event("mousemove", (event) => { panel.readout.textContent = this.told(panel, event.x); });
        panel.plot.on_event("mouseleave", () => this.rest(panel));
        panel.stop.addEventListener("keydown", (event) => this.keyed(panel, event));
        panel.stop.addEventListener("focus", () => {
          if (this.where(panel) === undefined && panel.stop.matches(":focus-visible")) panel.readout.textContent = HINT;
        });
        panel.stop.addEventListener("blur", () => this.rest(panel));
        new ResizeObserver(() => this.reserve(panel)).observe(panel.stop);
      }
    }

    // Room for the longest text that a panel may tell, so that nothing moves when it does.
    reserve(panel) {
      const { readout, plot: { x_range } } = panel;
      const ends = [x_range.start, (x_range.start + x_range.end) / 2, x_range.end];
      const texts = [HINT, ...ends.map((x) => `${this.told(panel, x).replace(/ (?=[\d.])/g, " −")}00`)];
      const said = readout.textContent;
      readout.style.minHeight = "";
      readout.textContent = texts.reduce((a, b) => (b.length > a.length ? b : a));
      const { height } = readout.getBoundingClientRect();
      readout.textContent = said;
      readout.style.minHeight = `${height}px`;
    }

    where(panel) {
      return this.at.get(panel.plot.x_range);
    }

    // What stands beside a panel's title when the mouse is elsewhere.
    rest(panel) {
      panel.readout.textContent = panel.line.visible ? this.told(panel, this.where(panel)) : "";
    }

    keyed(panel, event) {
      const what = KEYS[event.key];
      if (!what || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      if (what === "reset") this.put(panel, undefined);
      if (AFTER[what]) {
        this.zoom(what, (range) => this.at.get(range));
        const x = this.where(panel);
        this.said.textContent = AFTER[what] + (x === undefined ? "" : `, ${this.told(panel, x)}`);
        return;
      }
      const times = longest(panel);
      if (times.length) this.put(panel, this.next(times, panel.plot.x_range, what));
    }

    // Where the cursor goes; when there is none yet, to an end of what is in view.
    next(times, range, what) {
      const { start, end } = range;
      const at = this.at.get(range);
      const last = times.length - 1;
      if (what === "first" || what === "last") return times[what === "first" ? 0 : last];
      const on = what.endsWith("on");
      if (at === undefined) return times[nearest(times, on ? start : end)];
      const least = (end - start) * (what.startsWith("far") ? LEAP : STEP);
      let index = nearest(times, at);
      const from = times[index];
      do index += on ? 1 : -1;
      while (index > 0 && index < last && Math.abs(times[index] - from) < least);
      return times[Math.min(Math.max(index, 0), last)];
    }

    // The cursor at x, or away, in all panels of this axis; what is in view follows it.
    put(panel, x) {
      const range = panel.plot.x_range;
      const half = (range.end - range.start) / 2;
      this.at.set(range, x);
      if (x < range.start || x > range.end) range.setv({ start: x - half, end: x + half });
      for (const each of this.panels.filter(({ plot }) => plot.x_range === range)) {
        if (x !== undefined) each.line.location = x;
        each.line.visible = x !== undefined;
        this.rest(each);
      }
      if (x !== undefined) this.said.textContent = this.told(panel, x);
    }

    // Where that is - its name, date or time - and the values of all lines shown.
    told(panel, x) {
      const { axes, plot } = panel;
      const lines = drawn(panel);
      const height = axes.logarithmic ? 0 : (plot.y_range.end - plot.y_range.start) / 1000;
      const unit = axes.unit && ` ${axes.unit}`;
      let where = "";
      const values = new Map();
      for (const [label, [times, y]] of lines) {
        const index = nearest(times, x);
        if (this.names.length === times.length) where = this.names[index];
        if (Number.isFinite(y[index])) values.set(label, `${label} ${number(y[index], height)}${unit}`);
      }
      if (!where && this.dated) where = new Date(x).toISOString().slice(0, 16).replace("T", " ");
      const times = longest(panel);
      const step = (times[times.length - 1] - times[0]) / (times.length - 1);
      if (!where) where = `${axes.x} = ${number(x, step)}${axes.x_unit && ` ${axes.x_unit}`}`;
      const order = [...this.order.filter((label) => values.has(label)), ...values.keys()];
      return `${where}: ${[...new Set(order)].map((label) => values.get(label)).join(", ") || "no value"}`;
    }
  }
  return Cursor;
})();
