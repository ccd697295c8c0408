// The files of certificates, keys and passwords that are configured.
#pragma once

#include "server/http/app/wing.h"
#include "server/options.h"

namespace isomesh {

using http::ConfiguredFiles;

// Throws Error kInvalidParameter that names each file which cannot be read: of the files that
// options and the URL of --store name, and of those of wings, `others`.
void check_configured_files(const Options& options, const ConfiguredFiles& others = {});

}  // namespace isomesh
