// Service class user of C-STORE (PS3.4, B): sends one object over its own association.
#pragma once

#include "server/process/dimse_message.h"

namespace isomesh::dimse {

// Sends the object over the process's connection.
process::DimseSent send_object(const process::DimseSending& order);

}  // namespace isomesh::dimse
