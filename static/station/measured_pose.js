/** Before the pose: a photograph of this hand that was just measured gives the pose's angles, if the hand still lies so. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";

const FRESH = 30 * 60_000; // ms
const SHOWN = ["pose_ready"];

export function mount(root, api, { station, session }) {
  const box = errorBox();
  const place = h("div", {});
  root.append(place, box.element);
  let shown = "";

  async function look() {
    const all = await api.get(`/api/patients/${session.patient.id}/photographs`);
    const one = all.find((p) => p.hand === session.hand && Date.now() - Date.parse(p.taken) < FRESH);
    place.replaceChildren(...(one ? offer(one) : []));
  }

  function offer(photograph) {
    const said = h("p", { role: "status" });
    const use = async () => {
      await api.put(`/api/stations/${station.latest.station}/measured-pose`, { photograph: photograph.id });
      said.textContent = t("photograph.pose.used");
      button.remove();
    };
    const button = h("button", { type: "button", onclick: () => once(button, box, use) }, t("photograph.pose"));
    return [h("p", { class: "soft" }, t("photograph.pose.lead", { when: dayAndTime(photograph.taken) })), said, button];
  }

  return station.on("full", ({ wizard }) => {
    if (wizard.state === shown) return;
    shown = wizard.state;
    box.clear();
    place.replaceChildren();
    if (SHOWN.includes(shown)) look().catch((error) => box.show(error));
  });
}
