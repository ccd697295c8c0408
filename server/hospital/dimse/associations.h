// The two associations that the program can have with a peer.
#pragma once

#include "server/hospital/dimse/message.h"

namespace isomesh::dimse {

// Service class provider of C-STORE and C-ECHO (PS3.4, B and A). Serves the association that a peer
// requests on the process's connection. Reports each object to the daemon, and responds with the
// daemon's verdict.
dimse::DimseEnded receive_association(const dimse::DimseReceiving& order);

// Service class user of C-STORE (PS3.4, B): sends one object over the process's connection.
dimse::DimseSent send_object(const dimse::DimseSending& order);

}  // namespace isomesh::dimse
