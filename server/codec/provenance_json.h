// The origin of a mesh, as files carry it. Private to this folder.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "server/codec/encode.h"

namespace isomesh::codec {

// The volume, the parameters, the iso-value used (none by labels), the lattice, units and space of
// the positions, and the volume's notes, if any.
nlohmann::ordered_json provenance_json(const Provenance& provenance);

std::string provenance_text(const Provenance& provenance);

// The program that makes the files: "isomesh, mesher 2". Without the version of the release,
// because releases with the same mesher make the same bytes.
std::string application();

// As text without characters that XML escapes: some readers do not unescape.
std::string provenance_for_xml(const Provenance& provenance);

}  // namespace isomesh::codec
