// Schemas of openapi.yaml that follow from tables other than that of parameters. Private to this
// folder.
#pragma once

#include <string>

namespace isomesh {

// The formats of uploads, with what a client shows and looks for.
std::string schema_of_volume_formats();

// The formats of meshes, with their names and those that hold all labels.
std::string schema_of_mesh_formats();

// All codes of notes with their meanings, and the codes that can be accepted.
std::string schemas_of_notes();

// The names of the stages, and the object of their times.
std::string schemas_of_stages();

}  // namespace isomesh
