"use strict";
document.querySelectorAll(".cell").forEach(cell => cell.addEventListener("click", () => cell.classList.toggle("large")));
document.querySelectorAll(".copy").forEach(button => button.addEventListener("click", () => {
  const code = button.previousElementSibling, range = document.createRange();
  range.selectNodeContents(code);
  const chosen = getSelection(); chosen.removeAllRanges(); chosen.addRange(range);
  const done = () => { button.textContent = "copied"; };
  if (navigator.clipboard) navigator.clipboard.writeText(code.textContent).then(done, () => {});
  else if (document.execCommand("copy")) done();
}));
