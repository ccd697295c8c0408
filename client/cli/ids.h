// Ids on the command line, which may be shortened; private to this folder.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "client/isomesh/client.h"

namespace isomesh::cli {

struct Candidate {
  std::string id;
  std::string title;  // distinguishes it from others, for a person
};

// True for text that could be a volume's id or a shortened one: at least four hexadecimal digits.
bool may_be_volume_id(const std::string& text);

// True for an argument FILE that names no file but could be a volume's id.
bool is_stored_volume(const std::filesystem::path& path);

// The only id that equals, begins with or ends with `text`. Throws Error kNotFound if there is
// none, and kInvalidParameter, which lists them, if there are several. `kind` is "volume", "job"
// and so on.
std::string whole_id(const std::string& text, const std::string& kind,
                     const std::vector<Candidate>& candidates);

// The full ids on the server. Full ids and those with fewer than four characters are returned
// unchanged, without a request. Throws Error as whole_id and Client do.
std::string volume_id(Client& client, const std::string& text);
std::string job_id(Client& client, const std::string& text);
// The same for objects with the ids of jobs.
std::string timed_id(const std::string& text, const std::string& kind,
                     const std::function<std::vector<Candidate>()>& candidates);

// All volumes, or the newest page of jobs, for completion by shells. `kind` is "volumes" or "jobs".
std::vector<Candidate> ids_of(Client& client, const std::string& kind);

}  // namespace isomesh::cli
