// The files of certificates, keys and passwords that are configured.
#pragma once

#include "server/http/app/wing.h"
#include "server/options.h"

namespace isomesh {

using http::ConfiguredFiles;

// Both throw Error kInvalidParameter that names each file which cannot be read: of the files that
// options name, as every start needs them; and also of those that the URL of --store names, and of
// those of wings, `others`.
void check_option_files(const Options& options);
void check_configured_files(const Options& options, const ConfiguredFiles& others);

}  // namespace isomesh
