/** Passkeys as the browser offers them: from what the server asks to what it is answered. */

/** Whether this browser can, at this address. */
export const offered = () => Boolean(globalThis.PublicKeyCredential?.parseRequestOptionsFromJSON);

/** Have the browser make a passkey. */
export async function make(options) {
  const made = await navigator.credentials.create({ publicKey: PublicKeyCredential.parseCreationOptionsFromJSON(options) });
  return /** @type {PublicKeyCredential} */ (made).toJSON();
}

/** Have the browser prove itself with one. */
export async function prove(options) {
  const proof = await navigator.credentials.get({ publicKey: PublicKeyCredential.parseRequestOptionsFromJSON(options) });
  return /** @type {PublicKeyCredential} */ (proof).toJSON();
}
