// The channels of a recording as tabs, and matrices of which one is shown. The search of the browser
// finds hidden ones, too, and they are printed.

function startTabs(root) {
  const jump = root.querySelector("p.jump");
  const panels = [...root.querySelectorAll("section.channel")];
  if (!jump || panels.length < 2) return;
  const list = element("div");
  list.setAttribute("role", "tablist");
  list.setAttribute("aria-label", "Channels");
  const nameOfPanel = (panel) => panel.getAttribute("aria-labelledby");
  const tabs = panels.map((panel) => {
    panel.id = `channel-${nameOfPanel(panel)}`;
    panel.setAttribute("role", "tabpanel");
    const tab = element("button", { type: "button", textContent: panel.querySelector("h2").textContent, onclick: () => select(panel) });
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", panel.id);
    return tab;
  });
  const showAll = () => {
    put(panels);
    keep("channel", "all");
  };
  const all = element("button", { type: "button", textContent: "all channels", onclick: showAll });
  const put = (shownPanels) => {
    panels.forEach((panel, place) => {
      const here = shownPanels.includes(panel);
      if (here) panel.removeAttribute("hidden");
      else panel.setAttribute("hidden", "until-found");
      const alone = here && shownPanels.length === 1;
      tabs[place].setAttribute("aria-selected", String(alone));
      tabs[place].tabIndex = alone || (shownPanels.length > 1 && place === 0) ? 0 : -1;
    });
    all.setAttribute("aria-pressed", String(shownPanels.length > 1));
  };
  const select = (panel) => {
    put([panel]);
    keep("channel", panel === panels[0] ? null : nameOfPanel(panel));
  };
  list.addEventListener("keydown", (event) => {
    const at = tabs.indexOf(document.activeElement);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const next = (to + tabs.length) % tabs.length;
    select(panels[next]);
    tabs[next].focus();
  });
  panels.forEach((panel) => panel.addEventListener("beforematch", () => select(panel)));
  // A link into another tab opens that tab.
  const panelOf = (name) => panels.find((panel) => panel.contains(document.getElementById(name)));
  root.addEventListener("click", (event) => {
    const link = event.target.closest?.("a[href^='#']");
    const panel = link && panelOf(decodeURIComponent(link.getAttribute("href").slice(1)));
    if (panel?.hidden) put([panel]);
  });
  list.append(...tabs);
  jump.replaceWith(element("div", { className: "tabs" }, list, all));
  const section = decodeURIComponent(location.hash.split("#").at(-1));
  const first = panelOf(section) ?? panels.find((panel) => nameOfPanel(panel) === state.get("channel")) ?? panels[0];
  put(state.get("channel") === "all" && !panelOf(section) ? panels : [first]);
  if (panelOf(section)) document.getElementById(section).scrollIntoView();
}

function startMatrices(root) {
  const matrices = [...root.querySelectorAll("[data-matrix]")];
  if (matrices.length < 2) return;
  const select = element("select", {}, ...matrices.map((one, place) => new Option(one.dataset.matrix, String(place))));
  const put = () => matrices.forEach((one, place) => (one.hidden = place !== Number(select.value)));
  select.value = String(Math.max(0, matrices.findIndex((one) => one.dataset.matrix === state.get("matrix"))));
  select.addEventListener("change", () => {
    put();
    keep("matrix", matrices[Number(select.value)].dataset.matrix);
  });
  matrices[0].before(element("form", { className: "chooser" }, labelled("Quantity and averaging time", select)));
  put();
}

// Hidden channels must be visible before their figures are drawn for print.
function startPrintingTabs() {
  let before = [];
  window.addEventListener("beforeprint", () => {
    before = [...document.querySelectorAll("section.channel[hidden]")];
    before.forEach((panel) => panel.removeAttribute("hidden"));
  });
  window.addEventListener("afterprint", () => before.forEach((panel) => panel.setAttribute("hidden", "until-found")));
}

kinds.budget = (figure) => {
  const bars = [...pageData.budgets[Number(figure.dataset.budget)]].reverse();
  return stackedShares(bars.map((bar) => bar.label), bars.map((bar) => bar.shares), bars.map((bar) => bar.label), figure.clientWidth);
};
