/** Sends what may need a second look: where the server has doubts they are said, and the person confirms or changes what was typed. */
import { h } from "../dom.js";
import { once } from "../forms.js";
import { t } from "../words/words.js";

/** `send(more)` sends with `more` among the facts; `done(what it gave)` goes on. */
export async function confirming(box, send, done) {
  try {
    await done(await send({}));
  } catch (error) {
    if (!error.confirm?.length) throw error;
    const anyway = h("button", { type: "button", onclick: () => once(anyway, box, async () => done(await send({ confirmed: true }))) });
    anyway.append(t("confirm.code"));
    const reasons = error.confirm.map((doubt) => h("li", {}, t(`doubt.${doubt}`)));
    box.warn(t("confirm.name"), h("ul", {}, reasons), h("p", {}, t("confirm.next")), h("div", { class: "buttons" }, anyway));
  }
}
