// A search over all named entries. The index is a file that is loaded on the first search, or a part
// of the page in a report of one file.

const MOST_FOUND = 12;
let searched = null;

function loadSearch() {
  searched ??= new Promise((found) => {
    const own = document.getElementById("search-index");
    if (own) return found(JSON.parse(own.textContent));
    window.imubenchSearch = found;
    document.head.append(element("script", { src: document.body.dataset.plotting.replace("plotly.min.js", "search.js") }));
  });
  return searched;
}

// Every word must occur; entries whose title begins with them come first.
function searchFor(text, entries) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  if (words.length === 0) return [];
  return entries.map((entry) => {
    const [kind, title, , more] = entry;
    const [own, all] = [title.toLowerCase(), `${title} ${kind} ${more}`.toLowerCase()];
    if (!words.every((word) => all.includes(word))) return { entry, rank: 9 };
    const inTitle = words.filter((word) => own.includes(word)).length;
    return { entry, rank: (own.startsWith(words[0]) ? 0 : 1) + (words.length - inTitle) * 2 };
  }).filter(({ rank }) => rank < 9).sort((a, b) => a.rank - b.rank).map(({ entry }) => entry);
}

function startSearch() {
  const units = document.querySelector("header .units");
  if (!units || document.getElementById("search-index")?.textContent === "[]") return; // a single log
  const root = (document.body.dataset.plotting ?? "").replace("assets/plotly.min.js", "");
  const form = element("form", { className: "search" });
  form.setAttribute("role", "search");
  const field = element("input", { type: "search", placeholder: "Search everything", autocomplete: "off" });
  field.setAttribute("aria-label", "Search everything");
  const said = element("output");
  const list = element("ul", { hidden: true });
  const show = async () => {
    const text = field.value.trim();
    const found = text ? searchFor(text, await loadSearch()) : [];
    if (field.value.trim() !== text) return;
    list.hidden = found.length === 0;
    list.replaceChildren(...found.slice(0, MOST_FOUND).map(([kind, title, path]) => {
      const badge = element("span", { className: "badge", textContent: kind });
      return element("li", {}, element("a", { href: root + path, textContent: title }, " ", badge));
    }));
    said.textContent = text === "" ? "" : found.length > MOST_FOUND ? `the first ${MOST_FOUND} of ${found.length}` : `${found.length} found`;
  };
  const close = () => {
    field.value = "";
    show();
  };
  field.addEventListener("focus", loadSearch, { once: true });
  field.addEventListener("input", show);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    list.querySelector("a")?.click();
  });
  form.addEventListener("click", (event) => event.target.closest("a") && window.setTimeout(close));
  form.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    const stops = [field, ...list.querySelectorAll("a")];
    if (event.key === "Escape") {
      close();
      field.focus();
    } else if (step) {
      event.preventDefault();
      stops[Math.min(Math.max(stops.indexOf(document.activeElement) + step, 0), stops.length - 1)].focus();
    }
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "/" || event.target.matches("input, select, textarea")) return;
    event.preventDefault();
    field.focus();
  });
  form.append(field, said, list);
  units.before(form);
}
