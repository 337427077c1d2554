// Tables that can be sorted by a column and filtered by the data of their rows. A long table has its
// first rows in the page; the others are packed as text and become rows when they are needed.
// The address holds sorting and filters by the name of the table: #recordings.status=rejected.

const FEW = 100;

function startTables(root) {
  const names = new Set();
  root.querySelectorAll("table.sortable").forEach((table) => {
    const name = unused(slug(table.closest(".scroll").getAttribute("aria-label")), names);
    new LongTable(table, name);
  });
  const lost = [...state.keys()].filter((key) => key.includes(".") && !names.has(key.split(".")[0]));
  if (lost.length > 0) root.prepend(warned(`The address asks for a table that is not on this page: ${lost.join(", ")}.`));
}

function unused(name, names) {
  let free = name || "unnamed";
  for (let n = 2; names.has(free); n++) free = `${name}-${n}`;
  names.add(free);
  return free;
}

const warned = (text) => element("p", { className: "unfound", textContent: text });

class LongTable {
  constructor(table, name) {
    this.table = table;
    this.name = name;
    this.unknown = [];
    this.body = table.tBodies[0];
    this.further = table.closest(".scroll").nextElementSibling;
    if (!this.further?.matches("script.rows")) this.further = null;
    this.rows = [...this.body.rows];
    this.asked = {};
    this.selects = new Map();
    this.all = false;
    this.order = null;
    const columns = new Set();
    this.sorts = new Map();
    [...table.tHead.rows[0].cells].forEach((head, column) => this.addSort(head, column, columns));
    this.bar = element("form", { className: "filters", onsubmit: (event) => event.preventDefault() });
    this.count = element("output");
    this.more = element("button", { type: "button", hidden: true, onclick: () => {
      this.all = true;
      this.note("rows", "all");
      this.show();
    } });
    if (table.dataset.filters !== undefined) this.addFilters(JSON.parse(table.dataset.filters));
    if (this.further) {
      this.count.textContent = `the first ${this.rows.filter((row) => !row.hidden).length} rows`;
      this.more.hidden = false;
      this.more.textContent = "show all";
      this.bar.append(this.count, this.more);
    }
    if (this.bar.childElementCount > 0) table.closest(".scroll").before(this.bar);
    const stated = this.restore();
    if (stated || (Object.values(this.asked).some(Boolean) && !this.further)) this.show();
    if (this.unknown.length > 0) table.closest(".scroll").before(warned(`The address has filters that this table does not have; they are ignored: ${this.unknown.join(", ")}.`));
  }

  note(key, value) {
    keep(`${this.name}.${key}`, value);
  }

  // Applies sorting and filters of the address; unknown ones are reported.
  restore() {
    let stated = false;
    for (const [whole, value] of [...state]) {
      if (!whole.startsWith(`${this.name}.`)) continue;
      const key = whole.slice(this.name.length + 1);
      const select = this.selects.get(key);
      const sort = key === "sort" ? this.sorts.get(value.replace(/^-/, "")) : null;
      if (key === "find" && this.search) {
        this.search.value = value;
        this.asked.text = value.trim().toLowerCase();
      } else if (select && (value === "all" || [...select.options].some((option) => option.value === value))) {
        select.value = this.asked[key] = value === "all" ? "" : value;
      } else if (sort) sort(value.startsWith("-") ? -1 : 1);
      else if (key === "rows" && value === "all") this.all = true;
      else {
        this.unknown.push(`${key} “${value}”`);
        continue;
      }
      stated = true;
    }
    return stated;
  }

  // All rows, including those that were not in the page yet.
  get every() {
    if (this.further) {
      const holder = element("template", { innerHTML: `<table><tbody>${this.further.textContent}</tbody></table>` });
      this.rows.push(...holder.content.querySelectorAll("tr"));
      this.further.remove();
      this.further = null;
    }
    return this.rows;
  }

  addSort(head, column, columns) {
    if (head.dataset.sort === undefined) return;
    const name = unused(slug(head.dataset.name ?? head.textContent), columns);
    const sort = (direction) => {
      this.table.querySelectorAll("thead th[aria-sort]").forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
      this.order = { column, direction, kind: head.dataset.sort };
    };
    this.sorts.set(name, sort);
    const button = element("button", { type: "button", className: "sort" });
    button.setAttribute("aria-label", `Sort by ${head.dataset.name ?? head.textContent.trim()}`);
    button.addEventListener("click", () => {
      // The largest value comes first if it is the best.
      const [first, second] = head.dataset.first === "descending" ? [-1, 1] : [1, -1];
      const before = head.getAttribute("aria-sort");
      const direction = before === (first === 1 ? "ascending" : "descending") ? second : first;
      sort(direction);
      this.note("sort", direction === 1 ? name : `-${name}`);
      this.show();
    });
    head.append(button);
  }

  addFilters(filters) {
    this.search = element("input", { type: "search", oninput: () => {
      this.asked.text = this.search.value.trim().toLowerCase();
      this.note("find", this.search.value.trim());
      this.show();
    } });
    this.bar.append(labelled("Find", this.search));
    for (const [key, values] of Object.entries(filters)) {
      if (values.length < 2) continue;
      const first = this.table.dataset[`first${capital(key)}`] ?? "";
      const select = element("select", {}, new Option("all", ""), ...values.map((value) => new Option(value, value)));
      select.value = this.asked[key] = first;
      select.addEventListener("change", () => {
        this.asked[key] = select.value;
        this.note(key, select.value === first ? null : select.value || "all");
        this.show();
      });
      this.selects.set(key, select);
      this.bar.append(labelled(capital(key), select));
    }
    this.clear = element("button", { type: "button", hidden: true, textContent: "clear the filters", onclick: () => {
      for (const key of Object.keys(this.asked)) this.asked[key] = "";
      this.search.value = "";
      this.note("find", null);
      this.selects.forEach((each, key) => {
        each.value = "";
        this.note(key, this.table.dataset[`first${capital(key)}`] ? "all" : null);
      });
      this.show();
    } });
    this.bar.append(this.count, this.more, this.clear);
  }

  fits(row, besides = null) {
    return Object.entries(this.asked).every(([key, value]) =>
      !value || key === besides || (key === "text" ? row.textContent.toLowerCase().includes(value) : row.dataset[key] === value));
  }

  show() {
    const fitting = this.every.filter((row) => this.fits(row));
    if (this.order) sortRows(fitting, this.order);
    const shown = this.all ? fitting : fitting.slice(0, FEW);
    shown.forEach((row) => (row.hidden = false));
    this.body.replaceChildren(...shown);
    showUnits(this.body);
    const those = fitting.length === this.rows.length ? `${fitting.length} rows` : `${fitting.length} of ${this.rows.length} rows${fitting.length ? "" : this.why()}`;
    this.count.textContent = shown.length < fitting.length ? `the first ${shown.length} of ${those}` : those;
    this.more.hidden = shown.length === fitting.length;
    this.more.textContent = `show all ${fitting.length}`;
    if (this.clear) this.clear.hidden = fitting.length > 0;
    this.offer();
  }

  // Which filters leave no row, and how many rows there would be without each.
  why() {
    const asked = Object.entries(this.asked).filter(([, value]) => value);
    const word = (key) => (key === "text" ? "Find" : capital(key));
    const without = asked.map(([key]) => [word(key), this.rows.filter((row) => this.fits(row, key)).length]).filter(([, left]) => left > 0);
    const parts = [`no row has ${asked.map(([key, value]) => `${word(key)} “${value}”`).join(" and ")}`, ...without.map(([name, left]) => `${left} without ${name}`)];
    return `: ${parts.join("; ")}`;
  }

  // A filter offers the values that the other filters leave.
  offer() {
    this.selects.forEach((select, key) => {
      const left = new Set(this.rows.filter((row) => this.fits(row, key)).map((row) => row.dataset[key]));
      for (const option of select.options) option.disabled = option.value !== "" && !left.has(option.value);
    });
  }
}

function sortRows(rows, { column, direction, kind }) {
  const collator = new Intl.Collator("en", { numeric: true });
  const keys = new Map(rows.map((row) => [row, sortKey(row, column, kind)]));
  rows.sort((first, second) => {
    const [a, b] = [keys.get(first), keys.get(second)];
    if (a === null || b === null) return (a === null) - (b === null); // unknown values come last
    return direction * (typeof a === "number" ? a - b : collator.compare(a, b));
  });
}

function sortKey(row, column, kind) {
  const cell = row.cells[column];
  const value = cell.dataset.order ?? cell.dataset.value ?? (cell.classList.contains("none") ? "" : cell.querySelector("data")?.value);
  const text = value ?? cell.textContent.trim();
  if (kind !== "number") return text;
  return text === "" || Number.isNaN(Number(text)) ? null : Number(text);
}

const capital = (text) => text[0].toUpperCase() + text.slice(1);

const labelled = (text, ...inside) => element("label", {}, `${text} `, ...inside);
