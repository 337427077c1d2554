// The address holds the choices of the reader, so that a link opens the same view: #axis=…&b=…, or
// #/PATH#axis=… in a report of one file. Default choices are left out.

let state = new URLSearchParams();

function element(name, properties = {}, ...inside) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...inside);
  return made;
}

const inOneFile = () => document.body.dataset.oneFile === "yes";

function stateText(hash) {
  const last = hash.slice(1).split("#").pop();
  return last.includes("=") ? last : "";
}

const readState = () => (state = new URLSearchParams(stateText(location.hash)));

function keep(key, value) {
  if (value === null || value === "") state.delete(key);
  else state.set(key, value);
  const place = inOneFile() ? `#/${location.hash.slice(2).split("#")[0] || "index.html"}` : "";
  const text = state.toString();
  history.replaceState(null, "", `${location.pathname}${location.search}${place}${text ? `#${text}` : inOneFile() ? "" : "#"}`);
}

async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const field = element("textarea", { value: text });
    document.body.append(field);
    field.select();
    const copied = document.execCommand("copy");
    field.remove();
    return copied;
  }
}

function startCopying() {
  const units = document.querySelector("header .units");
  if (!units) return;
  const said = element("output");
  const copy = async () => {
    said.textContent = (await copyText(location.href)) ? "copied" : location.href;
    window.setTimeout(() => (said.textContent = ""), 3000);
  };
  units.append(element("button", { type: "button", className: "copy", textContent: "Copy link", onclick: copy }), said);
  if (!inOneFile()) {
    window.addEventListener("hashchange", () => stateText(location.hash) && location.reload());
  }
}
