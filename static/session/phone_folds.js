/** On a phone what is not at one glance is a line with its heading, folded until it is wanted. */
import { h } from "../dom.js";

const PHONE = matchMedia("(max-width: 40rem)");

/** Fold the cards of these places, once they are drawn; on a wider screen they stay. */
export function foldOnPhone(places) {
  if (!PHONE.matches) return;
  const cards = places.flatMap((place) => (place.classList.contains("card") ? [place] : [...place.querySelectorAll(":scope > .card")]));
  const isFolded = (card) => card.matches("details, :has(> details:only-child)");
  cards.filter((card) => !isFolded(card)).forEach(fold);
}

function fold(card) {
  const heading = card.querySelector("h2");
  if (!heading) return;
  const details = h("details", { class: "card fold" }, h("summary", {}, heading.cloneNode(true)));
  card.before(details);
  details.append(card);
}
