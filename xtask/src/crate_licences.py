"""List the crates inside of packages of ours, with the licence that each is under and the text of it.

Arguments: the output file, the packages. Standard input: what `cargo metadata` says.
"""

import json
import pathlib
import sys

# How the names of files with a licence begin.
TEXTS = ("COPYING", "COPYRIGHT", "LICENCE", "LICENSE", "NOTICE", "UNLICENSE")

metadata = json.load(sys.stdin)
packages = {package["id"]: package for package in metadata["packages"]}
nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}

# What is linked, or writes code that is: neither for tests nor for build scripts alone.
inside = set()
waiting = [package["id"] for package in packages.values() if package["name"] in sys.argv[2:]]
while waiting:
    package = waiting.pop()
    if package in inside:
        continue
    inside.add(package)
    for dependency in nodes[package]["deps"]:
        if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
            waiting.append(dependency["pkg"])

# Without a source it is ours.
others = [packages[package] for package in inside if packages[package]["source"]]
others.sort(key=lambda package: (package["name"], package["version"]))

users = {}
unlicensed = []
for package in others:
    if not (package["license"] or package["license_file"]):
        unlicensed.append(package["name"])
    folder = pathlib.Path(package["manifest_path"]).parent
    for file in sorted(folder.iterdir()):
        if file.name.upper().startswith(TEXTS) and file.is_file():
            users.setdefault(file.read_text(errors="replace").strip(), []).append(package["name"])
if unlicensed:
    sys.exit(f"these crates name no licence: {', '.join(unlicensed)}")

with open(sys.argv[1], "w") as out:
    print("canter holds these crates, each under the licence beside it.\n", file=out)
    for package in others:
        licence = package["license"] or package["license_file"]
        print(f"{package['name']} {package['version']}: {licence}", file=out)
    for text, names in users.items():
        print(f"\n{'=' * 80}\nFrom {', '.join(dict.fromkeys(names))}:\n\n{text}", file=out)
