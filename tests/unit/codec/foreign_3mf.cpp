#include "tests/unit/codec/foreign_3mf.h"

#include <memory>
#include <stdexcept>

#include <Model/COM/NMR_DLLInterfaces.h>

namespace isomesh::test {
namespace {

using Handle = void*;

struct Release {
  void operator()(Handle handle) const { NMR::lib3mf_release(static_cast<Handle*>(handle)); }
};
using Held = std::unique_ptr<void, Release>;

void check(int result, const char* what) {
  if (result != 0) {
    throw std::runtime_error(std::string(what) + ": lib3mf's error " + std::to_string(result));
  }
}

// Returns the handle that a call of lib3mf writes to its last argument.
template <class Call, class... Arguments>
Held object_of(const char* what, Call call, Arguments... arguments) {
  Handle* handle = nullptr;
  check(call(arguments..., &handle), what);
  return Held(handle);
}

Handle* in(const Held& held) { return static_cast<Handle*>(held.get()); }

template <class Call, class... Arguments>
std::string text_of(const char* what, Call call, Arguments... arguments) {
  ULONG needed = 0;
  check(call(arguments..., nullptr, 0, &needed), what);
  std::string text(needed + 1, '\0');
  check(call(arguments..., text.data(), static_cast<ULONG>(text.size()), &needed), what);
  text.resize(needed);
  return text;
}

std::optional<std::array<std::uint8_t, 3>> color_of(Handle* object) {
  const Held handler =
      object_of("a property", NMR::lib3mf_object_createdefaultpropertyhandler, object);
  NMR::eModelPropertyType type = NMR::MODELPROPERTYTYPE_NONE;
  check(NMR::lib3mf_defaultpropertyhandler_getpropertytype(in(handler), &type), "its type");
  if (type == NMR::MODELPROPERTYTYPE_NONE) return std::nullopt;
  if (type != NMR::MODELPROPERTYTYPE_COLOR) throw std::runtime_error("a property is no colour");
  NMR::MODELMESHCOLOR_SRGB color = {};
  check(NMR::lib3mf_defaultpropertyhandler_getcolor(in(handler), 0, &color), "a colour");
  if (color.m_Alpha != 0xff) throw std::runtime_error("a colour is transparent");
  return std::array<std::uint8_t, 3>{color.m_Red, color.m_Green, color.m_Blue};
}

Object3mf read_object(Handle* object) {
  Object3mf result;
  result.name = text_of("a name", NMR::lib3mf_object_getnameutf8, object);
  result.part_number = text_of("a part number", NMR::lib3mf_object_getpartnumberutf8, object);
  DWORD type = 0;
  check(NMR::lib3mf_object_gettype(object, &type), "a type");
  result.is_model = type == NMR::MODELOBJECTTYPE_MODEL;
  result.color = color_of(object);
  DWORD points = 0;
  DWORD triangles = 0;
  check(NMR::lib3mf_meshobject_getvertexcount(object, &points), "vertices");
  check(NMR::lib3mf_meshobject_gettrianglecount(object, &triangles), "triangles");
  for (DWORD v = 0; v < points; ++v) {
    NMR::MODELMESHVERTEX vertex;
    check(NMR::lib3mf_meshobject_getvertex(object, v, &vertex), "a vertex");
    result.points.push_back({vertex.m_fPosition[0], vertex.m_fPosition[1], vertex.m_fPosition[2]});
  }
  for (DWORD t = 0; t < triangles; ++t) {
    NMR::MODELMESHTRIANGLE triangle;
    check(NMR::lib3mf_meshobject_gettriangle(object, t, &triangle), "a triangle");
    result.triangles.push_back(
        {triangle.m_nIndices[0], triangle.m_nIndices[1], triangle.m_nIndices[2]});
  }
  return result;
}

void refuse_if(bool is_moved) {
  if (is_moved) throw std::runtime_error("an object is moved");
}

void read_objects(Handle* object, Model3mf& model) {
  BOOL has_components = 0;
  check(NMR::lib3mf_object_iscomponentsobject(object, &has_components), "an object");
  if (has_components == 0) {
    model.objects.push_back(read_object(object));
    return;
  }
  model.together = text_of("a name", NMR::lib3mf_object_getnameutf8, object);
  DWORD components = 0;
  check(NMR::lib3mf_componentsobject_getcomponentcount(object, &components), "components");
  for (DWORD n = 0; n < components; ++n) {
    const Held component =
        object_of("a component", NMR::lib3mf_componentsobject_getcomponent, object, n);
    BOOL is_moved = 0;
    check(NMR::lib3mf_component_hastransform(in(component), &is_moved), "a place");
    refuse_if(is_moved != 0);
    read_objects(in(object_of("an object", NMR::lib3mf_component_getobjectresource, in(component))),
                 model);
  }
}

}  // namespace

Model3mf read_with_lib3mf(const std::string& bytes) {
  const Held model = object_of("a model", NMR::lib3mf_createmodel);
  const Held reader = object_of("a reader", NMR::lib3mf_model_queryreader, in(model), "3mf");
  std::string copy = bytes;
  check(NMR::lib3mf_reader_readfrombuffer(in(reader), reinterpret_cast<BYTE*>(copy.data()),
                                          copy.size()),
        "a file");
  DWORD warnings = 0;
  check(NMR::lib3mf_reader_getwarningcount(in(reader), &warnings), "warnings");
  for (DWORD n = 0; n < warnings; ++n) {
    DWORD code = 0;
    throw std::runtime_error("lib3mf warns: " + text_of("a warning",
                                                        NMR::lib3mf_reader_getwarningutf8,
                                                        in(reader), n, &code));
  }

  Model3mf result;
  DWORD unit = 0;
  check(NMR::lib3mf_model_getunit(in(model), &unit), "the unit");
  result.is_in_millimetres = unit == NMR::MODELUNIT_MILLIMETER;
  DWORD entries = 0;
  check(NMR::lib3mf_model_getmetadatacount(in(model), &entries), "metadata");
  for (DWORD n = 0; n < entries; ++n) {
    const std::string key = text_of("metadata", NMR::lib3mf_model_getmetadatakeyutf8, in(model), n);
    result.metadata[key] =
        text_of("metadata", NMR::lib3mf_model_getmetadatavalueutf8, in(model), n);
  }
  const Held items = object_of("items", NMR::lib3mf_model_getbuilditems, in(model));
  BOOL has_next = 0;
  while (check(NMR::lib3mf_builditemiterator_movenext(in(items), &has_next), "items"), has_next) {
    const Held item = object_of("an item", NMR::lib3mf_builditemiterator_getcurrent, in(items));
    BOOL is_moved = 0;
    check(NMR::lib3mf_builditem_hasobjecttransform(in(item), &is_moved), "a place");
    refuse_if(is_moved != 0);
    ++result.items;
    read_objects(in(object_of("an object", NMR::lib3mf_builditem_getobjectresource, in(item))),
                 result);
  }
  return result;
}

}  // namespace isomesh::test
