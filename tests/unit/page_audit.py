"""What a reader without a mouse or without eyes needs of a page, looked for in a browser."""

#: What is not as it should be: language, title, landmarks, order of headings, and tables.
STRUCTURE = """() => {
  const wrong = [];
  const say = (what, e) => wrong.push(`${what}: ${e.outerHTML.slice(0, 120)}`);
  if (!/^[a-z]{2}/.test(document.documentElement.lang)) wrong.push("the page has no language");
  if (!document.title.trim()) wrong.push("the page has no title");
  if (document.querySelectorAll("main").length !== 1) wrong.push("not one main landmark");
  const headings = [...document.querySelectorAll("h1, h2, h3, h4, h5, h6")];
  if (headings.filter((h) => h.tagName === "H1").length !== 1) wrong.push("not one h1");
  let level = 0;
  for (const h of headings) {
    if (+h.tagName[1] > level + 1 || !h.textContent.trim()) say("a heading is empty or skips a level", h);
    level = +h.tagName[1];
  }
  for (const table of document.querySelectorAll("table")) {
    const head = [...table.tHead.rows[0].cells];
    if (head.some((c) => c.tagName !== "TH" || c.scope !== "col" || !c.textContent.trim())) {
      say("a column has no heading", table.tHead);
    }
    for (const row of table.tBodies[0].rows) {
      if (row.cells.length !== head.length) say("a row has not the columns of its table", row);
      if (![...row.cells].some((c) => c.scope === "row")) say("a row has no heading", row);
    }
  }
  for (const figure of document.querySelectorAll("figure")) {
    if (!figure.textContent.trim() || !figure.ariaLabel) say("a figure does not say what it shows", figure);
  }
  return wrong;
}"""
#: Roles that a screen reader announces by their names.
NAMED = {"image", "img", "table", "region", "navigation", "button", "checkbox", "figure", "toolbar", "link"}
NAMED |= {"application"}
#: The element that has the keyboard's focus: what it is, and whether one sees that it is here.
FOCUSED = """() => {
  const e = document.activeElement;
  if (!e || e === document.body) return null;
  const box = e.getBoundingClientRect();
  const style = getComputedStyle(e);
  const outlined = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2;
  const seen = outlined && box.width > 0 && box.bottom > 0 && box.top < innerHeight;
  window.stops = window.stops || new Set();
  const again = window.stops.has(e);
  window.stops.add(e);
  return { seen, again, what: e.outerHTML.slice(0, 100) };
}"""
REACHABLE = """() => [...document.querySelectorAll("a[href], button, input, summary, [tabindex='0']")]
  .filter((e) => e.checkVisibility()).length"""


def audited(page):
    """What is wrong with the page's structure, and what of it has no name in the browser's accessibility
    tree."""
    session = page.context.new_cdp_session(page)
    session.send("Accessibility.enable")
    wrong = page.evaluate(STRUCTURE)
    for node in session.send("Accessibility.getFullAXTree")["nodes"]:
        role = node.get("role", {}).get("value")
        if role in NAMED and not node.get("ignored") and not node["name"]["value"].strip():
            wrong.append(f"without a name: {role}")
    session.detach()
    return wrong


def walked(page):
    """What is wrong with the way of the Tab key through the page, from its first link: every stop once, each
    in sight, out of it at the end."""
    page.focus(".skip")
    stops, stop = [], page.evaluate(FOCUSED)
    while stop is not None and not stop["again"]:
        stops.append(stop)
        page.keyboard.press("Tab")
        stop = page.evaluate(FOCUSED)
    wrong = [f"focus cannot be seen: {stop['what']}" for stop in stops if not stop["seen"]]
    if stop is not None:
        wrong.append(f"the focus is caught: {stop['what']}")
    if len(stops) != page.evaluate(REACHABLE):
        wrong.append(f"{len(stops)} stops of {page.evaluate(REACHABLE)}")
    return wrong
