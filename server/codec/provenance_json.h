// What files say about where their mesh comes from; private to this folder.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "server/codec/encode.h"

namespace isomesh::codec {

// The volume and the parameters, the iso-value that was used (none by labels), the lattice, and
// units and space of the positions; the volume's notes where there are some.
nlohmann::ordered_json provenance_json(const Provenance& provenance);

// As text.
std::string provenance_text(const Provenance& provenance);

// As text without what XML escapes: some readers leave the text of elements as it stands.
std::string provenance_for_xml(const Provenance& provenance);

}  // namespace isomesh::codec
