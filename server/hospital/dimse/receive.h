// Service class provider of C-STORE and C-ECHO (PS3.4, B and A): one association.
#pragma once

#include "server/process/dimse_message.h"

namespace isomesh::dimse {

// Serves the association that a peer requests on the process's connection. Reports each object to
// the daemon, and responds with the daemon's verdict.
process::DimseEnded receive_association(const process::DimseReceiving& order);

}  // namespace isomesh::dimse
