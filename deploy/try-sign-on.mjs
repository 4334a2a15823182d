// An OpenID Connect provider to try single sign-on with, before the hospital's own one is asked: docs/deployment.md, Single sign-on. It lets in
// whoever types a name, with any password. In an empty folder: npm install oidc-provider (MIT, certified by the OpenID Foundation), then
//   node try-sign-on.mjs https://localhost:9443 cert.pem key.pem http://127.0.0.1:8420
// with the certificate of that name and its key, and the address under which a browser reaches Handscope. Node.js 20 or later.
import { createServer } from "node:https";
import { generateKeyPairSync, randomBytes } from "node:crypto";
import { readFileSync } from "node:fs";
import { Provider } from "oidc-provider";

const [issuer, certificate, key, handscope] = process.argv.slice(2);
const GROUPS = { anna: ["hand-therapists"], ben: ["movement-lab"], carl: ["kitchen"] }; // carl is refused: no role
const signing = generateKeyPairSync("rsa", { modulusLength: 2048 }).privateKey.export({ format: "jwk" });

const provider = new Provider(issuer, {
  clients: [
    {
      client_id: "handscope",
      client_secret: "a secret + any %signs",
      redirect_uris: [`${handscope}/login/sso/answer`],
      post_logout_redirect_uris: [`${handscope}/login`],
    },
  ],
  claims: { openid: ["sub"], profile: ["preferred_username", "groups"] },
  cookies: { keys: [randomBytes(16).toString("hex")] },
  jwks: { keys: [{ ...signing, kid: "1", alg: "RS256", use: "sig" }] },
  pkce: { required: () => true },
  findAccount: (_, id) => ({
    accountId: id,
    claims: () => ({ sub: id, preferred_username: id, ...(GROUPS[id] ? { groups: GROUPS[id] } : {}) }),
  }),
});
provider.on("grant.error", (_, error) => console.log(error.error, error.error_detail ?? error.error_description));
const { port } = new URL(issuer);
createServer({ cert: readFileSync(certificate), key: readFileSync(key) }, provider.callback()).listen(Number(port || 443), "127.0.0.1");
console.log(`${issuer}: HANDSCOPE_OIDC_SECRET='a secret + any %signs', --oidc-client handscope --oidc-claim groups`);
