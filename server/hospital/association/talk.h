// Messages between the program and the daemon, and the connection to the peer.
#pragma once

#include <string>
#include <string_view>

#include "server/process/dimse_message.h"

namespace isomesh::association {

// The first line from the daemon, which also passes the peer's connection. Empty if the daemon no
// longer needs this process.
std::string read_order();

int peer_socket();

// Ends the process if the daemon has closed its socket.
void say(std::string_view line);

// The daemon's verdict on the object reported last. Ends the process as say() does.
process::DimseVerdict hear_verdict();

}  // namespace isomesh::association
