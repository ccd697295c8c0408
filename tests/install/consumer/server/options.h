// Of this project, and called like one of the library.
#pragma once

#define CONSUMER_SERVER_OPTIONS_H 1
