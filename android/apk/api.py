#!/usr/bin/env python3
"""usage: api.py references LIST CLASSES...    |    api.py standins LIST CLASSES...

LIST: api/current.txt of a platform, such as API 29's of Debian's source package android-platform-frameworks-base.
references: every class and member of android.*, java.* and javax.* that the classes name is in the list, by descriptor with the returned type;
  nothing overrides what is final or leaves out what is abstract; nothing is called through invokedynamic, which no dexer without desugaring can take.
standins: classes that stand for the platform's promise nothing that the platform does not: kinds, modifiers, supertypes, descriptors,
  checked exceptions, values of constants. A class named StandIn... is the tests' own."""
import ast
import re
import sys

from apilist import Api
from classfile import read

PLATFORM = ("android/", "java/", "javax/")
SHOWN = {"public", "protected"}


def references(api, classes):
    wrong, used = set(), set()
    for one in classes.values():
        if one.dynamic_calls():
            wrong.add(f"{one.name}: {one.dynamic_calls()} calls through invokedynamic (a lambda, or compiled for Java 9 or newer)")
        for name, member, signature in one.references():
            if name.startswith("["):
                continue
            if not name.startswith(PLATFORM):
                if name not in classes:
                    wrong.add(f"{one.name}: {name} is neither the platform's nor in the app")
                continue
            used.add((name, member, signature))
            if name not in api.classes:
                wrong.add(f"{one.name}: no class {name}")
            elif member and not api.find(name, member, signature):
                wrong.add(f"{one.name}: no {name}.{member} {signature}")
        wrong.update(f"{one.name}: {text}" for text in overrides(api, classes, one))
        wrong.update(f"{one.name}: {text}" for text in unstated(api, classes, one))
    android = sum(1 for name, _, _ in used if name.startswith("android/"))
    print(f"{len(classes)} classes, {len(used)} references to the platform ({android} to android.*), {len(wrong)} wrong")
    return wrong


def overrides(api, classes, one):
    bases, todo = [], [one.extends, *one.interfaces]
    while todo:
        name = todo.pop()
        if name in classes:
            todo += [classes[name].extends, *classes[name].interfaces]
        elif name:
            bases.append(name)
    for modifiers, name, signature, _, _ in one.methods:
        if name.startswith("<") or modifiers & {"private", "static", "synthetic"}:
            continue
        for base in bases:
            for known in api.line(base):
                for (other, theirs), member in known.members.items():
                    if other != name or theirs.split(")")[0] != signature.split(")")[0]:
                        continue
                    if "final" in member.modifiers:
                        yield f"{name}{signature} overrides a final method of {known.name}"
                    if "public" in member.modifiers and "public" not in modifiers:
                        yield f"{name}{signature} is less visible than that of {known.name}"


def standins(api, classes):
    wrong, count = set(), 0
    for one in classes.values():
        simple = one.name.rpartition("/")[2].rpartition("$")[2]
        if not one.name.startswith(("android/", "javax/")) or simple.startswith("StandIn") or "StandIn" in one.name:
            continue
        if not SHOWN & one.modifiers:
            continue
        known = api.classes.get(one.name)
        if not known:
            wrong.add(f"{one.name}: no such class")
            continue
        wrong.update(f"{one.name}: {text}" for text in head(api, one, known))
        for member in one.fields + one.methods:
            if member[0] & SHOWN and "synthetic" not in member[0] and member[1] != "<clinit>":
                count += 1
                wrong.update(f"{one.name}.{member[1]} {member[2]}: {text}" for text in promise(api, one, member))
    print(f"{count} members of stand-ins looked up, {len(wrong)} wrong")
    return wrong


def head(api, one, known):
    kind = {"interface", "@interface"} if one.interface else {"class", "enum"}
    if known.kind not in kind:
        yield f"is {known.kind}"
    for word in ("final", "abstract", "static"):
        if known.kind == "enum" or one.interface:
            continue
        if (word in one.modifiers) != (word in known.modifiers):
            yield f"{word}: {word in one.modifiers}, the platform's: {word in known.modifiers}"
    for parent in [one.extends, *one.interfaces]:
        if not api.inherits(one.name, parent):
            yield f"does not inherit from {parent}"


def promise(api, one, member):
    modifiers, name, signature, throws, constant = member
    found = api.find(one.name, name, signature)
    if not found:
        yield "no such member"
        return
    theirs = found[1]
    words = {"public", "protected", "static", "final", "abstract"}
    if one.interface or "static" in modifiers:
        words -= {"final"} if name[:1].islower() else set()
    mine, other = modifiers & words, theirs.modifiers & words
    # An override may make what it inherits concrete, or public; an interface's members are public.
    if found[0].name != one.name:
        mine, other = mine - {"abstract", "final"}, other - {"abstract", "final"}
    if mine != other:
        yield f"modifiers {sorted(mine)}, the platform's {sorted(other)}"
    checked = lambda names: {n for n in names if api.checked(n)}
    if checked(throws) != checked(theirs.throws):
        yield f"throws {sorted(throws)}, the platform's {sorted(theirs.throws)}"
    if constant is not None and theirs.constant is not None and constant != value(theirs.constant):
        yield f"is {constant!r}, the platform's {theirs.constant}"


def value(text):
    if text.startswith('"'):
        return ast.literal_eval(text)
    if text in ("true", "false"):
        return int(text == "true")
    return float(text.rstrip("f")) if re.search(r"[.eE]", text) else int(text.rstrip("L"))


def unstated(api, classes, one):
    """Abstract methods of the platform that a concrete class of the app inherits and nobody implements."""
    if "abstract" in one.modifiers or one.interface:
        return
    done, todo, bases = set(), [one.name], []
    while todo:
        name = todo.pop()
        if name in classes:
            done |= {(m[1], m[2]) for m in classes[name].methods if "abstract" not in m[0]}
            todo += [classes[name].extends, *classes[name].interfaces]
        else:
            bases.append(name)
    line = [known for base in bases for known in api.line(base)]
    done |= {key for known in line for key, member in known.members.items() if "abstract" not in member.modifiers}
    for known in line:
        for (name, signature), member in known.members.items():
            # A type variable's erasure is not what the class states: the name and the count of arguments must do.
            if "abstract" in member.modifiers and (name, arguments(signature)) not in {(n, arguments(s)) for n, s in done}:
                yield f"does not implement {known.name}.{name}{signature}"


def arguments(signature):
    return len(re.findall(r"\[*(?:L[^;]+;|[ZBCSIJFD])", signature[1:signature.index(")")])) if "(" in signature else -1


def main():
    if len(sys.argv) < 4 or sys.argv[1] not in ("references", "standins"):
        sys.exit(__doc__)
    api = Api(sys.argv[2])
    wrong = {"references": references, "standins": standins}[sys.argv[1]](api, read(sys.argv[3:]))
    for text in sorted(wrong):
        print("WRONG", text)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
