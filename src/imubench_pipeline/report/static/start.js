// Runs when a page opens, or when the reader chooses a page of a report in one file.

// Features of the browser that the scripts need: decompression, and a recent part of the language.
const ABLE = typeof DecompressionStream === "function" && typeof [].at === "function";

async function openPage(main) {
  readState();
  if (!ABLE) return showPlain(main);
  await unfold(main);
  const data = main.querySelector("script[type='application/json'].page");
  pageData = data ? JSON.parse(data.textContent, withoutPrototype) : {};
  decoded = [];
  showUnits(main);
  startMine(main);
  startTables(main);
  startTabs(main);
  startCard(main);
  startMatrices(main);
  startRequirement(main);
  startChooser(main);
  startComparison(main);
  startFigures(main);
}

// Sensors, recordings and devices may have any name: without a prototype no mapping of a page has
// "constructor" or "toString" but where a sensor is called so.
function withoutPrototype(_key, value) {
  return value && typeof value === "object" && !Array.isArray(value) ? Object.setPrototypeOf(value, null) : value;
}

// Unpacks the parts of a page that `html.packed` has compressed: data, rows of tables, and markup.
async function unfold(root) {
  if (!ABLE) return;
  await Promise.all([...root.querySelectorAll("script[data-packed]")].map(async (script) => {
    const bytes = Uint8Array.from(atob(script.textContent), (sign) => sign.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const text = await new Response(stream).text();
    script.removeAttribute("data-packed");
    if (script.matches(".later")) script.outerHTML = text;
    else script.textContent = text;
  }));
}

// Without decompression the plain part of the page stays readable, with the notes for readers without
// JavaScript.
function showPlain(main) {
  main.querySelectorAll("figure[data-kind]").forEach((figure) => figure.remove());
  main.querySelectorAll("noscript").forEach((note) => (note.outerHTML = note.textContent));
  showUnits(main);
  const note = element("p", {
    className: "warnings",
    textContent: "This browser shows a part of this report: no figures, and only the first rows and sections. Use Chrome or Edge 92, Firefox 113, Safari 16.4, or a later version.",
  });
  note.setAttribute("role", "alert");
  main.prepend(note);
}

// One file: the pages lie in <template id="page:PATH">, and #/PATH or #/PATH#SECTION shows one.
async function startPages(main) {
  const pageOf = (path) => document.getElementById(`page:${path}`);
  let here = null;
  const show = async () => {
    const [path, section] = (location.hash.slice(2) || "index.html").split("#").map(decodeURIComponent);
    const page = pageOf(path) ? path : "index.html";
    if (page !== here || stateText(location.hash)) {
      here = page;
      const content = pageOf(page).content.cloneNode(true);
      await unfold(content);
      if (page !== here) return; // another was chosen meanwhile
      main.replaceChildren(content);
      document.title = main.querySelector("h1").textContent;
      document.querySelectorAll("header nav a").forEach((link) =>
        link.toggleAttribute("aria-current", resolved(link.getAttribute("href"), "") === page));
      await openPage(main);
    }
    if (section && document.getElementById(section)) openAround(section);
    else document.body.scrollIntoView();
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
    const hash = `#/${path.split("/").map(encodeURIComponent).join("/")}${section ? `#${section}` : ""}`;
    if (location.hash === hash) show();
    else location.hash = hash;
  });
  // The address determines the position: a browser would restore the previous one after this.
  history.scrollRestoration = "manual";
  window.addEventListener("hashchange", show);
  await show();
}

// Opens what is folded around the place of the address.
function openAround(id) {
  const place = id ? document.getElementById(decodeURIComponent(id)) : null;
  for (let each = place?.closest("details"); each; each = each.parentElement.closest("details")) each.open = true;
  place?.scrollIntoView();
}

async function start() {
  const main = document.querySelector("main");
  readState();
  startUnits(JSON.parse(document.body.dataset.units));
  startTerms();
  startSearch();
  startCopying();
  startPrintingTabs();
  startPrinting();
  if (document.body.dataset.oneFile === "yes") await startPages(main);
  else {
    await openPage(main);
    const open = () => openAround(location.hash.slice(1));
    window.addEventListener("hashchange", open);
    open();
  }
  document.documentElement.dataset.ready = "yes";
}

start();
