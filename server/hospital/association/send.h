// C-STORE as a user of the service (PS3.4, B): one object, over an association of its own.
#pragma once

#include "server/process/dimse_message.h"

namespace isomesh::association {

// Sends the object over the process's connection.
process::DimseSent send_object(const process::DimseSending& order);

}  // namespace isomesh::association
