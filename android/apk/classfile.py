"""Class files, as far as the checks of names need them (JVM specification, chapter 4)."""
import pathlib
import struct
import zipfile

FLAGS = {0x1: "public", 0x2: "private", 0x4: "protected", 0x8: "static", 0x10: "final", 0x100: "native", 0x400: "abstract", 0x1000: "synthetic"}


def flags(bits):
    return frozenset(name for bit, name in FLAGS.items() if bits & bit)


class ClassFile:
    def __init__(self, data):
        self.data, self.at = data, 8
        if data[:4] != b"\xca\xfe\xba\xbe":
            raise ValueError("not a class file")
        self.version = struct.unpack_from(">H", data, 6)[0]
        self.pool = self.constants()
        bits, this, base = self.take(">HHH")
        self.modifiers, self.interface = flags(bits), bool(bits & 0x200)
        self.name = self.class_name(this)
        self.extends = self.class_name(base) if base else None
        self.interfaces = [self.class_name(self.take(">H")[0]) for _ in range(self.take(">H")[0])]
        self.fields = [self.member() for _ in range(self.take(">H")[0])]
        self.methods = [self.member() for _ in range(self.take(">H")[0])]
        for name, body in self.attributes():
            if name == "InnerClasses":
                for i in range(struct.unpack_from(">H", body)[0]):
                    inner, _, _, bits = struct.unpack_from(">HHHH", body, 2 + 8 * i)
                    if self.class_name(inner) == self.name:  # the true modifiers of a nested class
                        self.modifiers = flags(bits)

    def take(self, form):
        values = struct.unpack_from(form, self.data, self.at)
        self.at += struct.calcsize(form)
        return values

    def constants(self):
        pool, (count,) = [None], self.take(">H")
        while len(pool) < count:
            (tag,) = self.take(">B")
            if tag == 1:
                (length,) = self.take(">H")
                pool.append(self.data[self.at:self.at + length].decode("utf-8", "replace"))
                self.at += length
            elif tag in (3, 4):
                pool.append((tag, self.take(">i" if tag == 3 else ">f")[0]))
            elif tag in (5, 6):
                pool += [(tag, self.take(">q" if tag == 5 else ">d")[0]), None]
            elif tag in (7, 8, 16, 19, 20):
                pool.append((tag, *self.take(">H")))
            elif tag == 15:
                pool.append((tag, *self.take(">BH")))
            else:
                pool.append((tag, *self.take(">HH")))
        return pool

    def class_name(self, index):
        return self.pool[self.pool[index][1]]

    def attributes(self):
        for _ in range(self.take(">H")[0]):
            name, length = self.take(">HI")
            body = self.data[self.at:self.at + length]
            self.at += length
            yield self.pool[name], body

    def member(self):
        bits, name, signature = self.take(">HHH")
        throws, constant = (), None
        for attribute, body in self.attributes():
            if attribute == "Exceptions":
                throws = tuple(self.class_name(i) for i in struct.unpack_from(f">{struct.unpack_from('>H', body)[0]}H", body, 2))
            elif attribute == "ConstantValue":
                value = self.pool[struct.unpack(">H", body)[0]]
                constant = self.pool[value[1]] if value[0] == 8 else value[1]
        return flags(bits), self.pool[name], self.pool[signature], throws, constant

    def references(self):
        """(class, member, descriptor) of all that is named; member and descriptor are None for a class alone."""
        for entry in self.pool:
            if not isinstance(entry, tuple):
                continue
            if entry[0] == 7:
                yield self.pool[entry[1]], None, None
            elif entry[0] in (9, 10, 11):
                what = self.pool[entry[2]]
                yield self.class_name(entry[1]), self.pool[what[1]], self.pool[what[2]]

    def dynamic_calls(self):
        return sum(1 for entry in self.pool if isinstance(entry, tuple) and entry[0] in (17, 18))


def read(places):
    """Class files of folders and jars, by name."""
    found = {}
    for place in places:
        path = pathlib.Path(place)
        if path.is_dir():
            contents = [f.read_bytes() for f in sorted(path.rglob("*.class"))]
        else:
            with zipfile.ZipFile(path) as jar:
                contents = [jar.read(n) for n in jar.namelist() if n.endswith(".class")]
        for data in contents:
            one = ClassFile(data)
            found[one.name] = one
    return found
