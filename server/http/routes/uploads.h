// What the routes of volumes and those of uploads in parts share; private to these.
#pragma once

#include <string>

#include "server/http/routes/routes.h"

namespace isomesh::http {

// A body that is here, and the name by which it is kept already; empty without one.
struct KeptBody {
  KeptUploads::Kept file;
  std::string name;
};

// Answers with the volumes that the body becomes when it is read as the request's query says.
void answer_volumes(App& app, const Request& request, Response& response, const KeptBody& body);

// Whether the request says that its body is the beginning of one.
bool begins_upload(const Request& request);

// Answers it with the place where the rest is to go. The query must have been looked at.
void begin_upload(App& app, const Request& request, Response& response);

// Lets go of what is kept where there is not so much room besides.
void make_room_for(App& app, std::uint64_t bytes);

}  // namespace isomesh::http
