// What the page can do beyond HTML: copy a table's source, and open what a link or a search points into.
(() => {
  "use strict";

  for (const source of document.querySelectorAll("details.source")) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Copy";
    const say = (text) => {
      button.textContent = text;
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    };
    button.addEventListener("click", async () => {
      const pre = source.querySelector("pre");
      try {
        await navigator.clipboard.writeText(pre.textContent);
        say("Copied");
      } catch {
        // Pages from a disk may not write to the clipboard: select, so that the reader's own keys copy.
        const range = document.createRange();
        range.selectNodeContents(pre);
        getSelection().removeAllRanges();
        getSelection().addRange(range);
        say(document.execCommand("copy") ? "Copied" : "Selected: press Ctrl+C");
      }
    });
    source.querySelector("summary").after(button);
  }

  const open = () => {
    const target = location.hash && document.getElementById(location.hash.slice(1));
    for (let node = target; node; node = node.parentElement) {
      if (node.tagName === "DETAILS") node.open = true;
    }
    if (target) target.scrollIntoView();
  };
  addEventListener("hashchange", open);
  open();
})();
