"""A base controller that is not there: real datagrams of what its wheels reckon."""
