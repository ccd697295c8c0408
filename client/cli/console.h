// Messages to users, and the client that the commands share; private to this folder.
#pragma once

#include <stop_token>
#include <string>

#include "base/error.h"
#include "client/cli/options.h"
#include "client/isomesh/client.h"

namespace isomesh::cli {

Client client_of(const Options& options, const std::stop_token& stop);

// A line on standard error. Safe to call from several threads.
void complain(const std::string& message);
// The error, and the options that would resolve it. `subject` is the input that it is about; empty
// if there is only one.
void complain(const Error& error, const std::string& subject = {});

// The hint for a user if no server responds.
void suggest_local();

// Reports the server's notes on a volume, unless `options` are quiet; `subject` as above.
void tell_notes(const Volume& volume, const Options& options, const std::string& subject);

}  // namespace isomesh::cli
