"""Threads of the desk: who watches over them, work in the background, answers on their way back."""
