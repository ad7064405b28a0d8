// Viewers of several cells: one is shown at a time, chosen by name or in the contact sheet, and the view goes with the
// choice.

class Cells {
  constructor(root) {
    this.sections = [...root.querySelectorAll(".viewer-cell")];
    const names = this.sections.map((section) => section.dataset.cell);
    this.menu = select(Object.fromEntries(names.map((name, i) => [i, name])));
    this.menu.addEventListener("change", () => this.show(Number(this.menu.value)));
    this.buttons = this.sections.map((section, i) => {
      const thumb = section.querySelector(".viewer-thumb");
      if (thumb) thumb.hidden = false;
      const button = make("button", { type: "button", title: names[i] }, ...(thumb ? [thumb] : []), make("span", {}, names[i]));
      button.addEventListener("click", () => this.show(i));
      return button;
    });
    const sheet = make("div", { class: "viewer-sheet", role: "group", "aria-label": "Contact sheet of all cells" }, ...this.buttons);
    root.prepend(make("label", { class: "viewer-choose" }, "Cell", this.menu), sheet);
    this.index = 0;
    this.show(0);
  }

  async show(index) {
    const [before, after] = [this.sections[this.index], this.sections[index]].map((s) => s.querySelector(".viewer"));
    const isOther = index !== this.index;
    this.index = index;
    this.menu.value = index;
    this.sections.forEach((section, i) => (section.hidden = i !== index));
    this.buttons.forEach((button, i) => button.setAttribute("aria-pressed", i === index));
    if (!isOther || !before || !after || !started.has(before)) return;
    const [from, to] = await Promise.all([start(before), start(after)]);
    if (from && to && this.index === index) await carry(from, to);
  }
}

document.querySelectorAll(".viewer-cells").forEach((root) => new Cells(root));

// Paper shows what is on the page, not only what was scrolled to.
const isSeen = (root) => root.checkVisibility();
const startSeen = () => roots.filter(isSeen).forEach(start);
addEventListener("beforeprint", startSeen);
addEventListener("load", () => {
  const later = window.requestIdleCallback ?? ((act) => setTimeout(act, 200));
  later(startSeen, { timeout: 2000 });
});
