// What happens when a page opens; in a report of one file, when a page of it is chosen.

function openPage(main) {
  readState();
  const data = main.querySelector("script[type='application/json'].page");
  pageData = data ? JSON.parse(data.textContent) : {};
  decoded = [];
  showUnits(main);
  startTables(main);
  startTabs(main);
  startMatrices(main);
  startChooser(main);
  startComparison(main);
  startFigures(main);
}

// One file: the pages lie in <template id="page:PATH">, and #/PATH or #/PATH#SECTION shows one.
function startPages(main) {
  const pageOf = (path) => document.getElementById(`page:${path}`);
  let here = null;
  const show = () => {
    const [path, section] = decodeURIComponent(location.hash.slice(2) || "index.html").split("#");
    const page = pageOf(path) ? path : "index.html";
    if (page !== here || stateText(location.hash)) {
      here = page;
      main.replaceChildren(pageOf(page).content.cloneNode(true));
      document.title = main.querySelector("h1").textContent;
      document.querySelectorAll("header nav a").forEach((link) =>
        link.toggleAttribute("aria-current", resolved(link.getAttribute("href"), "") === page));
      openPage(main);
    }
    (section && document.getElementById(section) ? document.getElementById(section) : document.body).scrollIntoView();
  };
  const resolved = (href, from) => {
    const parts = from.split("/").slice(0, -1);
    for (const part of decodeURIComponent(href).split("/")) part === ".." ? parts.pop() : parts.push(part);
    return parts.join("/");
  };
  document.addEventListener("click", (event) => {
    const link = event.target instanceof Element ? event.target.closest("a[href]") : null;
    if (!link || link.hasAttribute("download")) return;
    const [target, section] = link.getAttribute("href").split("#");
    const inHeader = link.closest("header") !== null;
    const path = target === "" ? here : resolved(target, inHeader ? "" : here);
    if (!pageOf(path)) return;
    event.preventDefault();
    const hash = `#/${encodeURI(path)}${section ? `#${section}` : ""}`;
    if (location.hash === hash) show();
    else location.hash = hash;
  });
  // The address says where to be: a browser that restores the place of before, on a reload, would
  // do so after this.
  history.scrollRestoration = "manual";
  window.addEventListener("hashchange", show);
  show();
}

function start() {
  const main = document.querySelector("main");
  readState();
  startUnits(JSON.parse(document.body.dataset.units));
  startTerms();
  startSearch();
  startCopying();
  startPrintingTabs();
  startPrinting();
  if (document.body.dataset.oneFile === "yes") startPages(main);
  else openPage(main);
}

start();
document.documentElement.dataset.ready = "yes";
