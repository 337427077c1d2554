// The card of a sensor as one picture, to send: name, figures, verdicts and events.

const CARD = { width: 1600, height: 900, edge: 40 };

function startCard(root) {
  const card = root.querySelector(".card");
  if (!card?.querySelector("figure")) return;
  card.querySelector(".links").append(element("button", { type: "button", textContent: "Save this summary as PNG", onclick: () => saveCard(card) }));
}

async function saveCard(card) {
  const { width, height, edge } = CARD;
  const sheet = element("canvas", { width, height });
  const drawn = sheet.getContext("2d");
  const { ink, soft, paper } = inks();
  drawn.fillStyle = paper;
  drawn.fillRect(0, 0, width, height);
  let level = edge;
  // A text in as many lines as it needs; it ends where the picture does.
  const write = (text, size, colour = ink, weight = "normal") => {
    drawn.font = `${weight} ${size}px system-ui, sans-serif`;
    drawn.fillStyle = colour;
    let line = "";
    for (const word of [...text.trim().split(/\s+/), null]) {
      const longer = `${line} ${word}`.trim();
      if (word !== null && drawn.measureText(longer).width < width - 2 * edge) line = longer;
      else if (level + size > height - edge) return;
      else {
        level += size * 1.3;
        drawn.fillText(line, edge, level);
        line = word;
      }
    }
  };
  write(card.querySelector("h1").innerText, 40, ink, "bold");
  write(card.querySelector(".lead").innerText, 22, soft);
  level += 12;
  const figures = [...card.querySelectorAll("figure")];
  const size = { width: (width - 2 * edge) / figures.length, height: 530 };
  for (const [place, figure] of figures.entries()) {
    const { data, layout } = figure.querySelector(".canvas");
    const picture = new Image();
    picture.src = await Plotly.toImage({ data, layout: { ...layout, ...size, paper_bgcolor: paper } }, { format: "png", ...size, scale: 2 });
    await picture.decode();
    drawn.drawImage(picture, edge + place * size.width, level, size.width, size.height);
  }
  level += size.height;
  for (const verdict of card.querySelectorAll(".standing > details > summary")) {
    const size = verdict.querySelector("span")?.innerText;
    write([verdict.querySelector("h2").innerText, size].filter(Boolean).join(": "), 21, getComputedStyle(verdict.querySelector("b")).color);
  }
  for (const text of card.querySelectorAll(".next li, .summary")) write(text.innerText, 18, soft);
  save(sheet.toDataURL("image/png"), `${slug(card.querySelector("h1").innerText)}.png`);
}
