/** Wards of the hospital as the server lists them, and what people read for one. */
import { t } from "../words/words.js";

const HOUSE = 1; // the number of the whole house

/** All wards with whether they are one's own; where there is but the whole house nothing about wards is shown. */
export async function loadWards(api) {
  const all = await api.get("/api/wards");
  return all.map((ward) => ({ ...ward, name: wardName(ward.id, ward.name) }));
}

export function wardName(number, name) {
  return number === HOUSE ? t("ward.all") : name;
}
