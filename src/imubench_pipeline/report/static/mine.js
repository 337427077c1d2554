// The reader's own sensor, pinned at its name: other numbers are then given as multiples of its.

let mine = null;

const sensorOf = (address) => decodeURIComponent(address ?? "").match(/sensors\/([^/#]+)\.html/)?.[1];

function startMine(main) {
  mine = state.get("mine") || (remembered("imubench mine") ?? mine) || null;
  if (mine && (location.hash === "" || stateText(location.hash))) keep("mine", mine);
  const show = () => {
    putPins(main);
    showMultiples(main);
  };
  if (main.dataset.pins) return show(); // another page of a report in one file
  main.dataset.pins = "yes";
  main.addEventListener("click", (event) => {
    const pin = event.target instanceof Element ? event.target.closest(".pin") : null;
    if (!pin) return;
    mine = pin.dataset.sensor === mine ? null : pin.dataset.sensor;
    keep("mine", mine);
    remember("imubench mine", mine ?? "");
    main.querySelectorAll(".mine").forEach((one) => one.remove());
    main.querySelectorAll("[data-multiple]").forEach((one) => one.removeAttribute("data-multiple"));
    main.querySelectorAll(".pin").forEach(drawPin);
    main.querySelector(".yours")?.dispatchEvent(new Event("pinned"));
    show();
  });
  // Rows and sections of tables are made on request.
  let waiting = 0;
  new MutationObserver(() => (waiting ||= window.setTimeout(() => {
    waiting = 0;
    show();
  }, 50))).observe(main, { childList: true, subtree: true });
  show();
}

function drawPin(pin) {
  const pinned = pin.dataset.sensor === mine;
  pin.textContent = pinned ? "★" : "☆";
  pin.setAttribute("aria-pressed", String(pinned));
}

// A pin at the first name of each sensor in a table, and at the title of its page.
function putPins(main) {
  const put = (place, sensor, name) => {
    if (!sensor || (place.closest("table") ?? place.parentElement).querySelector(`.pin[data-sensor="${CSS.escape(sensor)}"]`)) return;
    const pin = element("button", { type: "button", className: "pin", title: "My sensor: other sensors' numbers are shown as multiples of this sensor's" });
    pin.dataset.sensor = sensor;
    pin.setAttribute("aria-label", `My sensor: ${name}`);
    drawPin(pin);
    place.localName === "h1" ? place.append(" ", pin) : place.after(" ", pin);
  };
  main.querySelectorAll("th[scope=row] > a[href*='sensors/']").forEach((link) => put(link, sensorOf(link.getAttribute("href")), link.textContent));
  const title = main.querySelector("h1");
  put(title, sensorOf(inOneFile() ? location.hash : location.pathname), title.textContent);
}

// Numbers are <data value=SI> in a row of an axis, margins that name their source, and cells with
// data-mine, the key, and data-value.
async function showMultiples(main) {
  const own = mine === null ? null : (await loadModels())?.mine?.[mine];
  if (!own) return;
  const add = (place, value, reference, here = place) => {
    place.dataset.multiple = "";
    if (!(reference > 0) || !(value > 0)) return;
    const text = Math.abs(value / reference - 1) < 1e-4 ? "mine" : `${numberText(value / reference, 2)} × mine`;
    here.after(element("span", { className: "mine", textContent: text }));
  };
  for (const data of main.querySelectorAll("td > data:not([data-multiple])")) {
    const row = data.closest("tr");
    const [quantity, symbol] = (data.dataset.unit ?? unitOfColumn(data.closest("td")) ?? "").split(".");
    const axis = row.dataset.axis ?? row.closest("section.channel")?.id.split("_")[1];
    if (axis && symbol) add(data, Number(data.value), own[`${quantity}_${axis}.${symbol}`]);
  }
  for (const margin of main.querySelectorAll("[data-from$='/margin']:not([data-multiple])")) {
    const [, requirement, sensor, error, time] = margin.dataset.from.split("/");
    const reference = own[`${requirement}/${error}/${time}`];
    add(margin, sensor === mine ? reference : Number(margin.textContent), reference);
  }
  for (const cell of main.querySelectorAll("td[data-mine]:not([data-multiple])")) {
    if (cell.dataset.value) add(cell, Number(cell.dataset.value), own[cell.dataset.mine], cell.lastChild);
  }
}
