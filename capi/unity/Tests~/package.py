#!/usr/bin/env python3
"""Holds the files of the Unity package together: package.py FOLDER

Every asset has a .meta with a GUID of its own and the other way round, but for the libraries, which package.sh brings; the assembly definitions, the
manifest and the versions agree; every script that the scene names is there, with the fields that it sets; every object that it refers to is in it.
"""
import json
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
libraries = {"Plugins/Windows/visavis.dll", "Plugins/Linux/libvisavis.so", "Plugins/Android/libvisavis.so"}
problems = []
assets = {"package.json", "README.md"}
for folder in ["Runtime", "Unity", "Plugins"]:
    assets |= {folder} | {str(p.relative_to(root)) for p in (root / folder).rglob("*")}
sample = root / "Samples~/Conversation"
assets |= {str(p.relative_to(root)) for p in sample.rglob("*")}
metas = {name[:-5] for name in assets if name.endswith(".meta")} | {p.name[:-5] for p in root.glob("*.meta")}
assets = {name for name in assets if not name.endswith(".meta")}
for name in sorted((assets | libraries) ^ metas):
    problems.append(f"{name}: " + ("its .meta is missing" if name in assets else "there is a .meta, but no file"))
guids = {}
for name in sorted(metas):
    found = re.findall(r"^guid: ([0-9a-f]{32})$", (root / (name + ".meta")).read_text(), re.M)
    if len(found) != 1 or found[0] in guids:
        problems.append(f"{name}.meta: no GUID of its own")
    else:
        guids[found[0]] = name

manifest = json.loads((root / "package.json").read_text())
cargo = re.search(r'^version = "(.*)"', (root / "../Cargo.toml").read_text(), re.M)[1]
if manifest["version"] != cargo:
    problems.append(f"package.json says {manifest['version']}, capi/Cargo.toml {cargo}")
definitions = {p.parent.name: json.loads(p.read_text()) for p in root.glob("*/*.asmdef")}
names = {d["name"] for d in definitions.values()}
for folder, definition in definitions.items():
    unknown = set(definition["references"]) - names
    if unknown:
        problems.append(f"{folder}: no assembly {unknown}")
if not definitions["Runtime"]["noEngineReferences"] or any("UnityEngine" in p.read_text() for p in root.glob("Runtime/*.cs")):
    problems.append("Runtime must do without Unity")
for entry in manifest["samples"]:
    if not (root / entry["path"]).is_dir():
        problems.append(f"no sample in {entry['path']}")

scene = (sample / "Conversation.unity").read_text()
objects = set(re.findall(r"^--- !u!\d+ &(\d+)$", scene, re.M))
for number in set(re.findall(r"\{fileID: (\d+)\}", scene)) - objects - {"0"}:
    problems.append(f"the scene has no object {number}")
blocks = re.findall(r"m_Script: \{fileID: 11500000, guid: (\w+), type: 3\}\n(.*?)(?=\n---|\Z)", scene, re.S)
for guid, fields in blocks:
    script = guids.get(guid, "")
    if not script.endswith(".cs"):
        problems.append(f"the scene names script {guid}, which is not there")
        continue
    source = (root / script).read_text()
    for field in re.findall(r"^  (?!m_)([a-z]\w*):", fields, re.M):
        if not re.search(rf"public [\w\[\]]+ {field}\b", source):
            problems.append(f"{script} has no field {field}, which the scene sets")
if len(blocks) != 3:
    problems.append("the scene has three scripts")
if problems:
    sys.exit("\n".join(problems))
print(f"{len(guids)} GUIDs, {len(objects)} objects in the scene")
