// A short explanation of a term, on hover and on focus; Escape closes it.
// TERMS: key -> explanation; written by the page builder.

const tip = element("div", { id: "tip", hidden: true });
tip.setAttribute("role", "tooltip");

function showTip(term) {
  if (tip.parentNode !== document.body) document.body.append(tip);
  tip.textContent = TERMS[term.dataset.term];
  tip.hidden = false;
  term.setAttribute("aria-describedby", "tip");
  const place = term.getBoundingClientRect();
  const width = Math.min(320, document.documentElement.clientWidth - 16);
  tip.style.maxWidth = `${width}px`;
  const left = Math.min(place.left, document.documentElement.clientWidth - tip.offsetWidth - 8);
  tip.style.left = `${Math.max(8, left) + window.scrollX}px`;
  const above = place.bottom + tip.offsetHeight + 8 > window.innerHeight && place.top > tip.offsetHeight + 8;
  tip.style.top = `${(above ? place.top - tip.offsetHeight - 6 : place.bottom + 6) + window.scrollY}px`;
}

function hideTip(term) {
  tip.hidden = true;
  if (term) term.removeAttribute("aria-describedby");
}

function startTerms() {
  const of = (event) => (event.target instanceof Element ? event.target.closest("[data-term]") : null);
  for (const [shown, hidden] of [["mouseover", "mouseout"], ["focusin", "focusout"]]) {
    document.addEventListener(shown, (event) => of(event) && showTip(of(event)));
    document.addEventListener(hidden, (event) => of(event) && hideTip(of(event)));
  }
  document.addEventListener("keydown", (event) => event.key === "Escape" && hideTip(null));
}
