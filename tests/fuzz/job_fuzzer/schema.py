"""Makes values that a schema of openapi.yaml allows, and values that it does not allow. Checks values against a schema.

An unknown keyword is an error: a new kind of parameter must not go untested.
"""

import math
import re
import sys

import yaml

# They say nothing about the value.
SILENT = {"title", "description", "example", "examples", "format"}
KNOWN = SILENT | {
    "$ref", "type", "enum", "const", "oneOf", "allOf", "default", "properties", "additionalProperties", "required",
    "propertyNames", "items", "minItems", "maxItems", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum",
    "minLength", "maxLength", "pattern",
}
TYPES = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "number": lambda value: isinstance(value, (int, float)) and not isinstance(value, bool),
    "integer": lambda value: isinstance(value, int) and not isinstance(value, bool),
    "boolean": lambda value: isinstance(value, bool),
    "null": lambda value: value is None,
}
# One value of each type, and some that programs confuse.
STRANGERS = [None, True, False, 0, -1, 1.5, 2**31, 2**32, 2**63, 2**64, -(2**63) - 1, 1e300, -1e300, 5e-324, "", "1", "nan",
             "true", "\0", "\u202e\U0001f600", [], [[]], [None], {}, {"": 0}]
# How likely a member that may be left out is given, drawn anew for each object.
SHARES = [0.0, 0.1, 0.25, 0.5, 0.9]


class UnknownSchema(Exception):
    """openapi.yaml has something that the fuzzer does not know."""


def same(a, b):
    """Equality that tells True from 1."""
    return a == b and isinstance(a, bool) == isinstance(b, bool)


class Api:
    """The document."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as text:
            self.document = yaml.safe_load(text)

    def named(self, reference):
        node = self.document
        for part in reference.removeprefix("#/").split("/"):
            node = node[part]
        return node

    def resolved(self, node):
        while "$ref" in node:
            node = self.named(node["$ref"])
        return node

    def schema(self, node):
        """A schema with its `allOf` merged into it."""
        node = self.resolved(node)
        for keyword in node:
            if keyword not in KNOWN and not keyword.startswith("x-"):
                raise UnknownSchema(f"the fuzzer does not know the keyword {keyword} of a schema")
        merged = {key: value for key, value in node.items() if key != "allOf"}
        for part in node.get("allOf", []):
            merged = {**self.schema(part), **merged}
        return merged

    def types(self, schema):
        types = schema.get("type", [])
        types = [types] if isinstance(types, str) else types
        for each in types:
            if each not in TYPES:
                raise UnknownSchema(f"the fuzzer does not know the type {each}")
        return types

    def faults(self, value, node, where=""):
        """Each rule of the schema that a value breaks, as a text."""
        schema = self.schema(node)
        types = self.types(schema)
        if types and not any(TYPES[each](value) for each in types):
            return [f"{where} is not of type {types}"]
        if "const" in schema and not same(value, schema["const"]):
            return [f"{where} is not {schema['const']!r}"]
        if "enum" in schema and not any(same(value, each) for each in schema["enum"]):
            return [f"{where} is none of {schema['enum']}"]
        found = []
        if "oneOf" in schema and sum(not self.faults(value, each, where) for each in schema["oneOf"]) != 1:
            found.append(f"{where} is not one of several alternatives")
        if TYPES["number"](value):
            found += self.faults_of_number(value, schema, where)
        elif isinstance(value, str):
            found += self.faults_of_text(value, schema, where)
        elif isinstance(value, list):
            if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", math.inf):
                found.append(f"{where} has {len(value)} items")
            for place, item in enumerate(value):
                found += self.faults(item, schema.get("items", {}), f"{where}[{place}]")
        elif isinstance(value, dict):
            found += self.faults_of_object(value, schema, where)
        return found

    def faults_of_number(self, value, schema, where):
        limits = [("minimum", lambda least: value >= least), ("maximum", lambda most: value <= most),
                  ("exclusiveMinimum", lambda least: value > least), ("exclusiveMaximum", lambda most: value < most)]
        wrong = [f"{where} is {value!r}, {name} {schema[name]}" for name, fits in limits if name in schema and not fits(schema[name])]
        return wrong if math.isfinite(value) else [f"{where} is {value}"]

    def faults_of_text(self, value, schema, where):
        size = len(value.encode("utf-8", "surrogatepass"))
        if not schema.get("minLength", 0) <= size <= schema.get("maxLength", math.inf):
            return [f"{where} has {size} bytes"]
        if "pattern" in schema and not re.search(schema["pattern"], value):
            return [f"{where} does not match {schema['pattern']}"]
        return []

    def faults_of_object(self, value, schema, where):
        found = [f"{where} lacks {name}" for name in schema.get("required", []) if name not in value]
        properties = schema.get("properties", {})
        for name, member in value.items():
            inner = f"{where}.{name}" if where else name
            if name in properties:
                found += self.faults(member, properties[name], inner)
            elif schema.get("additionalProperties") is False:
                found.append(f"{inner} is not known")
            else:
                more = schema.get("additionalProperties", {})
                found += self.faults(member, more if isinstance(more, dict) else {}, inner)
                found += self.faults(name, schema.get("propertyNames", {}), f"the name {inner}")
        return found


class Maker:
    """Makes values by a random generator. `world` knows the volume: number(), integer(), point(), length()."""

    def __init__(self, api, rng, world):
        self.api = api
        self.rng = rng
        self.world = world

    def value(self, node):
        """A value that fits the schema."""
        schema = self.api.schema(node)
        if "default" in schema and self.rng.random() < 0.05:
            return schema["default"]
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return self.rng.choice(schema["enum"])
        if "oneOf" in schema and not self.api.types(schema):
            return self.value(self.rng.choice(schema["oneOf"]))
        types = self.api.types(schema)
        if not types:
            raise UnknownSchema(f"the fuzzer knows no value for {schema}")
        if set(types) == {"integer", "string"} and "pattern" in schema:
            return self.world.integer()  # a label; long ones alone are strings
        weights = [0.1 if each == "null" else 1 for each in types]
        return getattr(self, "make_" + self.rng.choices(types, weights)[0])(schema)

    def make_null(self, _):
        return None

    def make_boolean(self, _):
        return self.rng.random() < 0.5

    def limits(self, schema):
        """The smallest and the largest number, None for what is open; exclusive limits are moved inside."""
        least, most = schema.get("minimum"), schema.get("maximum")
        if "exclusiveMinimum" in schema:
            least = math.nextafter(schema["exclusiveMinimum"], math.inf)
        if "exclusiveMaximum" in schema:
            most = math.nextafter(schema["exclusiveMaximum"], -math.inf)
        return least, most

    def make_number(self, schema):
        least, most = self.limits(schema)
        choices = []
        if "x-unit" in schema:
            choices += [self.world.length()] * 4
        elif least is None and most is None:
            return self.world.number()
        if least is not None and most is not None:
            choices += [self.rng.uniform(least, most)] * 2
            choices.append(max(least, most * 10 ** self.rng.uniform(-6, 0)))
        choices += [each for each in (least, most) if each is not None]
        value = self.rng.choice(choices)
        value = value if least is None else max(least, value)
        return value if most is None else min(most, value)

    def make_integer(self, schema):
        least, most = self.limits(schema)
        if least is None or most is None:
            raise UnknownSchema(f"the fuzzer expects limits of an integer: {schema}")
        # Most are small. An integer whose limits reach below zero may be a value of the samples.
        small = least + int(10 ** self.rng.uniform(0, math.log10(min(most - least, 1000) + 1))) - 1
        choices = [small] * 3 + [self.rng.randint(least, most), least, most]
        if least < 0 and self.rng.random() < 0.9:
            choices = [self.world.integer()]
        return min(most, max(least, int(self.rng.choice(choices))))

    def make_string(self, schema):
        pattern = schema.get("pattern")
        if pattern == "^-?[0-9]+$":
            return str(self.world.integer())
        if pattern == "^#[0-9a-fA-F]{6}$":
            return f"#{self.rng.getrandbits(24):06x}"
        if pattern is not None:
            raise UnknownSchema(f"the fuzzer does not know texts like {pattern}")
        letters = self.rng.choice(["abc", " ./\\:", "<&>\"'#%", "äß€\U0001f600\u202e", "_-0123456789"])
        length = self.rng.choice([1, 2, 10, 60])
        return "x" + "".join(self.rng.choice(letters) for _ in range(length - 1))

    def make_array(self, schema):
        least, most = schema.get("minItems", 0), schema.get("maxItems", sys.maxsize)
        item = self.api.schema(schema["items"])
        if least == most == 3 and self.api.types(item) == ["number"] and not {"minimum", "maximum"} & set(item):
            return self.world.point()
        many = self.rng.choice([least, 1, 2, 3, 5, 12] if self.rng.random() < 0.98 else [100])
        return [self.value(item) for _ in range(max(least, min(most, many)))]

    def make_object(self, schema):
        if schema.get("additionalProperties") is False:
            chosen = dict(schema.get("properties", {}))
            return {name: self.value(chosen[name]) for name in self.names(schema)}
        if schema.get("properties"):
            raise UnknownSchema("the fuzzer does not know objects with some fixed members")
        names = {self.make_string(schema["propertyNames"]) for _ in range(self.rng.randint(0, 4))}
        return {name: self.value(schema["additionalProperties"]) for name in sorted(names)}

    def names(self, schema):
        """The members that an object gets: one of the alternatives of what is required, and some others."""
        required = set(schema.get("required", []))
        alternatives = [set(each["required"]) for each in schema.get("oneOf", [])]
        for each in schema.get("oneOf", []):
            if set(each) != {"required"}:
                raise UnknownSchema(f"the fuzzer does not know the alternative {each}")
        excluded = set()
        if alternatives:
            chosen = self.rng.choice(alternatives)
            required |= chosen
            excluded = set().union(*alternatives) - chosen
        properties = schema["properties"]
        kinds = {self.api.schema(properties[name]).get("x-jobs") for name in required} - {None}
        share = self.rng.choice(SHARES)
        taken = []
        for name, node in properties.items():
            kind = self.api.schema(node).get("x-jobs")
            is_foreign = name in excluded or (kind is not None and bool(kinds) and kind not in kinds)
            likely = 0.002 if is_foreign else share
            if name in required or self.rng.random() < likely:
                taken.append(name)
        return taken

    def wrong(self, node):
        """A value that does not fit the schema; None, which may fit, if none was found."""
        schema = self.api.schema(node)
        near = []
        for name, outwards in (("minimum", -1), ("maximum", 1), ("exclusiveMinimum", 0), ("exclusiveMaximum", 0)):
            if name in schema:
                limit = schema[name]
                near += [limit + outwards, math.nextafter(limit, limit + (outwards or -1) * math.inf)]
        if "items" in schema:
            fitting = self.value(schema["items"])
            near += [[fitting] * (schema.get("minItems", 0) - 1), [fitting] * min(schema.get("maxItems", 0) + 1, 2000)]
            near.append([self.wrong(schema["items"])])
        if "maxLength" in schema:
            near.append("x" * (schema["maxLength"] + 1))
        if "properties" in schema:
            near.append({self.rng.choice(["volumes", "Iso", "", "x" * 300, "\0", "__proto__"]): 1})
        candidates = near * 3 + STRANGERS
        wrong = [each for each in candidates if self.api.faults(each, schema)]
        return self.rng.choice(wrong) if wrong else None
