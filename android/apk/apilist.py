"""The platform's public API as its signature file (api/current.txt, format 2.0) states it: classes, members, erased descriptors."""
import re
from dataclasses import dataclass, field

PRIMITIVES = {"void": "V", "boolean": "Z", "byte": "B", "char": "C", "short": "S", "int": "I", "long": "J", "float": "F", "double": "D"}
MODIFIERS = {"public", "protected", "private", "abstract", "static", "final", "default", "synchronized", "native", "transient", "volatile", "strictfp"}
KINDS = {"class", "interface", "enum", "@interface"}


@dataclass
class Member:
    modifiers: frozenset
    throws: tuple = ()
    constant: str | None = None


@dataclass
class Class:
    name: str
    kind: str
    modifiers: frozenset
    variables: dict  # type variable -> erased internal type
    extends: str | None = None
    interfaces: list = field(default_factory=list)
    members: dict = field(default_factory=dict)  # (name, descriptor) -> Member

    def supers(self):
        return ([self.extends] if self.extends else []) + self.interfaces


def split(text, separator=","):
    """Parts between separators that stand outside of brackets."""
    parts, depth, part = [], 0, ""
    for c in text:
        depth += {"<": 1, "(": 1, "{": 1, ">": -1, ")": -1, "}": -1}.get(c, 0)
        if c == separator and depth == 0:
            parts.append(part)
            part = ""
        else:
            part += c
    return [p.strip() for p in parts + [part] if p.strip()]


def closing(text, start, pair):
    depth = 0
    for i in range(start, len(text)):
        depth += (text[i] == pair[0]) - (text[i] == pair[1])
        if depth == 0:
            return i
    raise ValueError(f"no {pair[1]} in {text}")


def without_annotations(text):
    out, i = "", 0
    while i < len(text):
        if text[i] == '"':  # a constant's text is no place for annotations
            return out + text[i:]
        found = re.match(r"@(?!interface\b)[\w.]+", text[i:])
        if found:
            i += found.end()
            if text[i:i + 1] == "(":
                i = closing(text, i, "()") + 1
            while text[i:i + 1] == " ":
                i += 1
        else:
            out += text[i]
            i += 1
    return out


def without_generics(text):
    out, depth = "", 0
    for c in text:
        depth += c == "<"
        if depth == 0:
            out += c
        depth -= c == ">"
    return out


def internal(name, variables):
    """Internal name of a class: what lies in no package is a type variable or in java.lang."""
    name = without_generics(name).strip()
    if name in variables:
        return variables[name]
    parts = name.split(".")
    first = next((i for i, p in enumerate(parts) if p[:1].isupper()), len(parts) - 1)
    package = parts[:first] or ["java", "lang"]
    return "/".join(package) + "/" + "$".join(parts[first:])


def descriptor(name, variables):
    name = without_generics(name).strip().removeprefix("final ").replace("...", "[]").replace(" ", "")
    depth = name.count("[]")
    name = name.replace("[]", "")
    return "[" * depth + (PRIMITIVES.get(name) or "L" + internal(name, variables) + ";")


def type_variables(text, outer):
    """`T extends A & B, E` -> erasures: the first bound, or Object."""
    variables = dict(outer)
    for parameter in split(text):
        variables[parameter.split()[0]] = "java/lang/Object"
    for parameter in split(text):
        name, _, bounds = parameter.partition(" extends ")
        if bounds:
            variables[name.strip()] = internal(split(bounds, "&")[0], variables)
    return variables


def leading(text, words):
    """Leading words of a set, and the rest."""
    found = set()
    while (word := text.split(" ", 1)[0]) in words and " " in text:
        found.add(word)
        text = text.split(" ", 1)[1].lstrip()
    return found, text


def generic_prefix(text, outer):
    if not text.startswith("<"):
        return outer, text
    end = closing(text, 0, "<>")
    return type_variables(text[1:end], outer), text[end + 1:].strip()


class Api:
    def __init__(self, path):
        self.classes = {}
        package = current = None
        with open(path, encoding="utf-8") as lines:
            for line in lines:
                text = without_annotations(line.strip())
                if found := re.match(r"package ([\w.]+) \{", text):
                    package = found[1]
                elif text.startswith(("method ", "ctor ", "field ", "enum_constant ")):
                    self.member(current, text.rstrip(";"))
                elif text.endswith("{"):
                    current = self.open(package, text[:-1].strip())

    def open(self, package, text):
        modifiers, rest = leading(text, MODIFIERS)
        kind, rest = rest.split(" ", 1)
        name = re.match(r"[\w.]+", rest)[0]
        outer = package.replace(".", "/") + "/" + name.rpartition(".")[0].replace(".", "$")
        variables = self.classes[outer].variables if "." in name and outer in self.classes and "static" not in modifiers else {}
        variables, rest = generic_prefix(rest[len(name):].strip(), variables)
        rest = without_generics(rest)
        known = Class(package.replace(".", "/") + "/" + name.replace(".", "$"), kind, frozenset(modifiers), variables)
        extends = re.search(r"\bextends ((?:[\w.]+ ?)+?)(?= ?implements|$)", rest)
        implements = re.search(r"\bimplements ([\w. ]+)", rest)
        if kind == "interface" or kind == "@interface":
            known.interfaces = [internal(n, variables) for n in ((extends or implements)[1].split() if extends or implements else [])]
            known.extends = "java/lang/Object"
        else:
            known.interfaces = [internal(n, variables) for n in (implements[1].split() if implements else [])]
            known.extends = "java/lang/Enum" if kind == "enum" else internal(extends[1], variables) if extends else "java/lang/Object"
        if known.name == "java/lang/Object":
            known.extends = None
        if kind == "enum":
            own = f"L{known.name};"
            public = frozenset({"public", "static"})
            known.members[("values", "()[" + own)] = Member(public)
            known.members[("valueOf", "(Ljava/lang/String;)" + own)] = Member(public)
        self.classes[known.name] = known
        return known

    @staticmethod
    def member(owner, text):
        kind, text = text.split(" ", 1)
        modifiers, text = leading(text, MODIFIERS)
        variables, text = generic_prefix(text, owner.variables)
        more, text = leading(text, MODIFIERS)
        modifiers |= more
        if kind in ("field", "enum_constant"):
            text, _, value = text.partition(" = ")
            value = re.sub(r"; //.*$", "", value).rstrip(";") if value else None
            typ, name = text.split("; //")[0].rstrip(";").rsplit(" ", 1)
            owner.members[(name, descriptor(typ, variables))] = Member(frozenset(modifiers), (), value or None)
            return
        end = closing(text, text.index("("), "()")
        head, arguments, tail = text[:text.index("(")], text[text.index("(") + 1:end], text[end + 1:]
        returns, _, name = head.strip().rpartition(" ")
        if kind == "ctor":
            name, returns = "<init>", "void"
        signature = "(" + "".join(descriptor(a, variables) for a in split(arguments)) + ")" + descriptor(returns, variables)
        throws = tuple(internal(t, variables) for t in split(tail.split("throws ", 1)[1].split(" default ")[0])) if "throws " in tail else ()
        if owner.kind in ("interface", "@interface") and not modifiers & {"default", "static"}:
            modifiers.add("abstract")
        owner.members[(name, signature)] = Member(frozenset(modifiers), throws)

    def line(self, name):
        """A class and all that it inherits from, nearest first; names that the list lacks are left out."""
        seen, todo = [], [name]
        while todo:
            known = self.classes.get(todo.pop(0))
            if known and known not in seen:
                seen.append(known)
                todo += known.supers()
        if seen and self.classes["java/lang/Object"] not in seen:
            seen.append(self.classes["java/lang/Object"])
        return seen

    def find(self, name, member, signature):
        """The class that declares a member as seen from `name`, and the member; None where there is none."""
        line = self.line(name)
        if member == "<init>":
            line = line[:1]
        return next(((c, c.members[(member, signature)]) for c in line if (member, signature) in c.members), None)

    def inherits(self, name, ancestor):
        return any(c.name == ancestor for c in self.line(name))

    def checked(self, exception):
        return not (self.inherits(exception, "java/lang/RuntimeException") or self.inherits(exception, "java/lang/Error"))
