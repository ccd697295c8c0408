#include "server/codec/provenance_json.h"

#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "proto/json_text.h"
#include "proto/json_tree.h"
#include "server/codec/mesher_version.h"

namespace isomesh::codec {

using Json = nlohmann::ordered_json;

Json provenance_json(const Provenance& provenance) {
  Json parameters = parse_json<Json>(to_json(provenance.parameters));
  // A file does not depend on the job's other files.
  parameters.erase("formats");
  Json json = {{"samples", provenance.samples}, {"parameters", parameters}};
  if (!provenance.parameters.labels) json["iso"] = provenance.iso;
  json.update({{"dims", provenance.dims},
               {"spacing", provenance.geometry.spacing},
               {"origin", provenance.geometry.origin},
               {"direction", provenance.geometry.direction},
               {"units", length_unit(provenance.notes).symbol},
               {"space", "LPS"}});
  // Only if there are notes: the meshes of other volumes keep their bytes.
  for (const Note& note : provenance.notes) {
    json["notes"].push_back({{"code", note.code}, {"detail", note.detail}});
  }
  return json;
}

std::string provenance_text(const Provenance& provenance) {
  return dump(provenance_json(provenance));
}

std::string application() { return std::string("isomesh, mesher ") + kMesherVersion; }

std::string provenance_for_xml(const Provenance& provenance) {
  std::string result;
  for (const char c : provenance_text(provenance)) {
    if (c == '&') {
      result += "\\u0026";
    } else if (c == '<') {
      result += "\\u003c";
    } else if (c == '>') {
      result += "\\u003e";
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace isomesh::codec
