#pragma once

#include "server/options.h"
#include "server/orders/hospital.h"

namespace isomesh {

// Throws Error kInvalidParameter that names each file of certificates, keys and passwords that is
// configured and cannot be read. `hospital` may be null.
void check_configured_files(const Options& options, const orders::Hospital* hospital);

}  // namespace isomesh
