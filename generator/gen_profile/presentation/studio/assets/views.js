// The page's views: each has a place of its own in the address, before the state: "#drive/…".
"use strict";
const views = (() => {
  const FIRST = "design";
  const links = [...document.querySelectorAll("#places a")];
  const names = links.map((link) => link.dataset.view);
  const watching = [];
  let state = ""; // as the address has it

  /** Which view an address names, and which state; one without a view is of the first. */
  function parse(hash = location.hash.slice(1)) {
    const [name, ...rest] = hash.split("/");
    return rest.length && names.includes(name) ? { name, state: rest.join("/") } : { name: FIRST, state: hash };
  }

  const current = () => document.body.dataset.show;
  const written = (name) => (name === FIRST ? (state ? `#${state}` : location.pathname) : `#${name}/${state}`);

  function show(name) {
    if (name === current()) return;
    document.body.dataset.show = name;
    for (const link of links) {
      if (link.dataset.view === name) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    scrollTo(0, 0);
    for (const act of watching) act(name);
  }

  /** Go to a view, from which the browser's button leads back. */
  function go(name) {
    if (name === current()) return;
    history.pushState(null, "", written(name));
    show(name);
  }

  /** Put a state into the address of this view, and of the links to the others. */
  function keep(address) {
    state = address;
    history.replaceState(null, "", written(current()));
    for (const link of links) link.href = written(link.dataset.view);
  }

  for (const link of links) {
    link.addEventListener("click", (event) => {
      if (event.ctrlKey || event.metaKey || event.shiftKey) return; // a window of its own
      event.preventDefault();
      go(link.dataset.view);
    });
  }
  addEventListener("popstate", () => {
    show(parse().name);
    history.replaceState(null, "", written(current())); // the state is what undo steps over
  });
  state = parse().state;
  show(parse().name);
  return { go, keep, current, watch: (act) => watching.push(act), state: () => state };
})();
