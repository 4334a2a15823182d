/** Who I am, and my password. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit } from "../forms.js";
import { t } from "../words/words.js";
import * as secondFactors from "./second_factors.js";

export function mount(root, api, { made }) {
  let gone = false;
  let leave = () => {};
  const box = errorBox();
  root.append(h("h1", {}, t("account.title")), box.element);
  api.get("/api/me").then((me) => gone || draw(me), box.show);

  function draw(me) {
    root.append(h("p", {}, t("account.is", { name: me.name, roles: me.roles.map((role) => t(`role.${role}`)).join(", ") })));
    if (me.local) root.append(h("p", { class: "soft" }, t("account.local")));
    else if (me.proof === "single") root.append(h("p", { class: "soft" }, t("account.single")));
    else root.append(passwordForm(api, me, box, offerSecond));
    if (me.proof === "password") offerSecond();
  }

  /** A second factor comes after a password. */
  function offerSecond() {
    if (root.querySelector(".second")) return;
    const place = h("div", { class: "second" });
    root.append(place);
    leave = secondFactors.mount(place, api, { made });
  }

  return () => {
    gone = true;
    leave();
  };
}

function passwordForm(api, me, box, next) {
  const secret = (autocomplete) => h("input", { type: "password", autocomplete, maxlength: 256 });
  const current = secret("current-password");
  const [first, second] = [secret("new-password"), secret("new-password")];
  const form = h(
    "form",
    { novalidate: true },
    h("input", { type: "text", autocomplete: "username", value: me.name, hidden: true, readonly: true }),
    me.proof === "password" && field(t("account.current"), current),
    field(t("account.password"), first, t("account.hint")),
    field(t("account.again"), second),
    h("button", { class: "primary", type: "submit" }, t("account.set")),
  );
  onSubmit(form, box, async () => {
    if (first.value !== second.value) throw new Error(t("account.differ"));
    await api.put("/api/me/password", { current: current.value, password: first.value });
    form.replaceWith(h("p", { class: "good-words", role: "status" }, t("account.done")));
    next();
  });
  return form;
}
