"""lib3mf's own C interface."""
import ctypes

from report import main, package_version, surface

library = ctypes.CDLL('lib3MF.so.1')


def call(name, *arguments):
    if getattr(library, f'lib3mf_{name}')(*arguments) != 0:
        raise RuntimeError(name)


def handle_of(name, *arguments):
    handle = ctypes.c_void_p()
    call(name, *arguments, ctypes.byref(handle))
    return handle


def text_of(name, *arguments):
    text = ctypes.create_string_buffer(1000)
    call(name, *arguments, text, len(text), ctypes.byref(ctypes.c_uint()))
    return text.value.decode()


def number_of(name, *arguments):
    number = ctypes.c_uint()
    call(name, *arguments, ctypes.byref(number))
    return number.value


def items(iterator, move, current):
    found = ctypes.c_int(1)
    while call(move, iterator, ctypes.byref(found)) or found.value:
        yield handle_of(current, iterator)


def main_color(thing):
    handler = handle_of('object_createdefaultpropertyhandler', thing)
    color = (ctypes.c_ubyte * 4)()
    call('defaultpropertyhandler_getcolor', handler, 0, color)
    return '#' + bytes(color[:3]).hex()


def read(path, _):
    model = handle_of('createmodel')
    reader = handle_of('model_queryreader', model, b'3mf')
    call('reader_readfromfileutf8', reader, path.encode())
    surfaces = []
    for thing in items(handle_of('model_getmeshobjects', model), 'resourceiterator_movenext', 'resourceiterator_getcurrent'):
        points = []
        for at in range(number_of('meshobject_getvertexcount', thing)):
            point = (ctypes.c_float * 3)()
            call('meshobject_getvertex', thing, at, point)
            points.append(list(point))
        triangles = number_of('meshobject_gettrianglecount', thing)
        surfaces.append(surface(points, triangles, name=text_of('object_getnameutf8', thing), colour=main_color(thing)))
    return surfaces


main(package_version('lib3mf1'), read)
