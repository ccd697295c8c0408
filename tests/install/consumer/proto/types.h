// Of this project, and called like one of the library.
#pragma once

#define CONSUMER_PROTO_TYPES_H 1
