"""Report pages opened in a browser, and what is measured there: widths, contrasts, broken words, and what a
plot tells of its values."""

import re

WIDTHS = (420, 1280, 1920)
#: Width of the text on A4 with margins of 14 mm, CSS pixels.
A4 = round((210 - 28) / 25.4 * 96)
LONG = "/data/recordings/of/some/robot/2026-11-23T06-37-00_a_very_long_name_without_any_space_that_wraps"
#: What waits for a condition evaluates it in the page, whose own policy forbids that; other tests keep it.
WATCHED = {"viewport": {"width": 1280, "height": 900}, "bypass_csp": True}


def opened(browser, report, alive=True, **options):
    """The page, with its first plot ``alive``, and a list of what went wrong and of what was asked for
    elsewhere."""
    page = browser.new_page(**options)
    wrong = []
    page.on("console", lambda m: wrong.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda e: wrong.append(str(e)))
    page.on("request", lambda r: wrong.append(r.url) if r.url.startswith(("http", "ws")) else None)
    page.goto(report.as_uri())
    if alive and options.get("java_script_enabled", True):
        page.wait_for_selector("figure.plot[data-ready=yes] canvas", state="attached")
    return page, wrong


def unfolded(page):
    """Open what is folded, and wait until every plot has come alive."""
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    for plot in page.locator("figure.plot").all():
        plot.scroll_into_view_if_needed()
        plot.locator("canvas").first.wait_for(state="attached")
    page.wait_for_selector("figure.plot:not([data-ready=yes])", state="detached")


def values_told(text):
    """Time and {line: value} of what a plot tells, such as t = 1.20 s: measured 0.41 rad, yours -0.39 rad."""
    x, values = re.fullmatch(r"t = ([−\d.]+) s: (.*)", text).groups()
    told = [re.fullmatch(r"(.*) ([−\d.]+)( rad(/s)?)?", part).groups()[:2] for part in values.split(", ")]
    return float(x), {name: float(value.replace("−", "-")) for name, value in told}


#: How far the page reaches beyond the window, and what of it does, all parts unfolded.
FITS = """() => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  const wide = document.documentElement.clientWidth;
  const out = [...document.querySelectorAll("body *")].filter((e) => {
    const box = e.getBoundingClientRect();
    const inside = e.closest(".scroll, .still, .skip") && !e.matches(".scroll, .still");
    return box.width && box.right > wide + 1 && !inside;
  });
  return { page: document.documentElement.scrollWidth - wide, out: out.map((e) => e.outerHTML.slice(0, 80)) };
}"""
#: Least contrast of each kind of text, and of each text of a picture, to what lies behind it.
CONTRASTS = """() => {
  const parse = (c) => c.match(/[\\d.]+/g).map(Number);
  const light = (c) => {
    const [r, g, b] = parse(c).slice(0, 3).map((v) => v / 255)
      .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = (e) => {
    for (; e; e = e.parentElement) {
      const [, , , a = 1] = parse(getComputedStyle(e).backgroundColor);
      if (a > 0) return getComputedStyle(e).backgroundColor;
    }
    return "rgb(255, 255, 255)";
  };
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  const found = {};
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.getClientRects().length || e.closest("script, style, metadata")) continue;
    const { color, fill } = getComputedStyle(e);
    const [a, b] = [light(e.closest("svg") ? fill : color), light(ground(e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const name = e.closest("svg") ? `in a picture: ${e.textContent}` : `${e.tagName}.${e.className}`;
    found[name] = Math.min(found[name] || 99, ratio);
  }
  return found;
}"""
#: Words that stand on two lines; a name may be broken where its parts meet.
BROKEN_WORDS = """() => {
  const found = [];
  for (const cell of document.querySelectorAll("th:not(.long), td:not(.long)")) {
    const texts = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
    for (let node; (node = texts.nextNode()); ) {
      for (const word of node.data.matchAll(/[^\\s-]+/g)) {
        const range = document.createRange();
        range.setStart(node, word.index);
        range.setEnd(node, word.index + word[0].length);
        if (new Set([...range.getClientRects()].map((r) => Math.round(r.top))).size > 1) found.push(word[0]);
      }
    }
  }
  return found;
}"""
