"""Add what lies in the repository itself to a CycloneDX list of the dependencies: Handscope, and files of others by version and SHA-256.

python .ci/sbom.py SBOM.json
"""

import json
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
MANIFEST = ROOT / "static" / "vendor" / "MANIFEST.txt"
TESTS = "tests/"  # what lies there is part of no installation


def vendored_components() -> list[dict[str, Any]]:
    """A component for each project, with its files."""
    found: dict[str, dict[str, Any]] = {}
    for line in MANIFEST.read_text().splitlines()[1:]:
        name, version, digest, path = line.split()
        if path.startswith(TESTS):
            continue
        component = {"type": "library", "name": name, "version": version, "scope": "required"}
        component |= {"bom-ref": f"vendored-{name}-{version}", "components": []}
        files = found.setdefault(name, component)["components"]
        hashes = [{"alg": "SHA-256", "content": digest}]
        files.append({"type": "file", "name": path, "bom-ref": path, "hashes": hashes})
    return list(found.values())


def main(path: Path) -> None:
    """Complete the list in place."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    listed = json.loads(path.read_text())
    listed["metadata"]["component"] = {
        "type": "application",
        "name": project["name"],
        "version": project["version"],
        "bom-ref": "handscope",
    }
    listed["components"] += vendored_components()
    path.write_text(json.dumps(listed, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
