// The files of certificates, keys and passwords that are configured.
#pragma once

#include "server/http/app/wing.h"
#include "server/options.h"

namespace isomesh {

using http::ConfiguredFiles;

// Throws Error kInvalidParameter that names each of them which cannot be read. `others` are those
// of wings.
void check_configured_files(const Options& options, const ConfiguredFiles& others);

}  // namespace isomesh
