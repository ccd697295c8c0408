#pragma once

#include "proto/json_text.h"

namespace isomesh::cli {

// The JSON schema of a job's parameters, from the table of parameters, without those that the tools
// set themselves: the volume, the formats and the callback.
nlohmann::ordered_json job_schema();

}  // namespace isomesh::cli
