"""The stub names what the module holds, no more and no less; and everything public says what it is."""

import ast
import inspect
import unittest

import tissuewarp
from tissuewarp import _core

from phantom import ROOT

STUB = ast.parse((ROOT / "python/tissuewarp/_core.pyi").read_text())
# What pybind11 gives every class, and Python every object.
OWN = {"__init__", "__call__"}


def names_of_stub(body):
    names = {}
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names[node.name] = node
        elif isinstance(node, ast.AnnAssign):
            names[node.target.id] = node
    return {name: node for name, node in names.items() if not name[0].isupper() or isinstance(node, ast.ClassDef)}


def names_of(thing):
    return {name for name in vars(thing) if not name.startswith("_") or name in OWN}


class Stubs(unittest.TestCase):
    def test_names_of_the_module(self):
        self.assertEqual(set(names_of_stub(STUB.body)), names_of(_core))

    def test_names_of_each_class(self):
        for name, node in names_of_stub(STUB.body).items():
            if isinstance(node, ast.ClassDef):
                held = names_of(getattr(_core, name))
                if "__init__" not in names_of_stub(node.body):
                    held.discard("__init__")  # classes that only functions make
                self.assertEqual(set(names_of_stub(node.body)), held, name)

    def test_arguments_of_each_function(self):
        for name, node in names_of_stub(STUB.body).items():
            if isinstance(node, ast.FunctionDef):
                said = getattr(_core, name).__doc__
                for argument in node.args.args:
                    self.assertRegex(said, rf"\b{argument.arg}: ", name)
                self.assertEqual(said.splitlines()[0].count(": "), len(node.args.args), said)

    def test_everything_public_is_listed_and_documented(self):
        public = {name for name, value in vars(tissuewarp).items()
                  if not name.startswith("_") and not inspect.ismodule(value)}
        self.assertEqual(public, set(tissuewarp.__all__))
        for name in tissuewarp.__all__:
            thing = getattr(tissuewarp, name)
            self.assertTrue(inspect.getdoc(thing), name)
            for member, value in vars(thing).items() if inspect.isclass(thing) else ():
                if not member.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                    self.assertTrue(inspect.getdoc(value), f"{name}.{member}")


if __name__ == "__main__":
    unittest.main()
