// C-STORE and C-ECHO as their provider (PS3.4, B and A): one association.
#pragma once

#include "server/process/dimse_message.h"

namespace isomesh::association {

// Serves the association that a peer begins on the process's connection. Each object is told to the
// daemon, and answered for as the daemon says.
process::DimseEnded receive_association(const process::DimseReceiving& order);

}  // namespace isomesh::association
